"""What runs the designs of a study: runners, threads, processes, clusters, the folder of a study."""
