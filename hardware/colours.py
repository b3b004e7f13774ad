"""The colours in which drawings and pictures show the mount's parts, red, green and blue."""

BASE = (120, 160, 190)
RING = (240, 170, 60)
ARM = (150, 190, 120)
KNOB = (220, 110, 90)
CRADLE = (190, 160, 210)
BAR = (170, 130, 200)
CLAMP = (205, 190, 160)
