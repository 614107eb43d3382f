"""The stages of a search: from what is asked to where it ends, one frozen state after the other."""
