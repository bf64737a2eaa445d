"""Plain XML for netconvert: lanes, movements, connections."""
