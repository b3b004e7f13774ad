"""Networks under test: their own speed, drivers that the appliance can run itself, and the closed loop that lets one drive."""
