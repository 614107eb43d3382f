"""Commands between samples: `holding` asks how they go there, `uncertain` how much of the force that leaves open."""
