"""The pages and the API: set up, watch, judge and take home from a browser. A process of its own without any device."""
