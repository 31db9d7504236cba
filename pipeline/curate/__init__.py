"""The page in the browser in which a person corrects contacts."""
