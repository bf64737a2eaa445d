"""Placeholder while the pipeline grows."""
class ConvertOptions: pass
def convert(): pass
