"""How fast a machine can go: the fastest motion along a path, and the factors by which motions can be sped up."""
