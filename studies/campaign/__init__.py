"""The study `campaign`: scenes that nobody chose, drawn from everything a scene file can say."""
