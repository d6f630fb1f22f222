"""The tissue: laws, spaces, weak forms, time, and the body made of them."""
