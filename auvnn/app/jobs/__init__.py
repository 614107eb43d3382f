"""What takes long, in a child process: the server's side of it, the process itself, and what it can do."""
