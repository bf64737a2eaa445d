"""What people look at: the views of an instant with its figures, as a picture, a video, or a live page."""
