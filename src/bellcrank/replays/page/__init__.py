"""The page that shows a film, and pictures of it."""
