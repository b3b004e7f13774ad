"""The accuracy certificate: simulated races, through the appliance's own rooms, against the truth of what was driven."""
