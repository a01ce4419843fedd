"""What the declaration of a scratch and the functions that trace one share."""

# forms of a cross-section
PROFILES = "quartic:DEPTH, v:HALF_ANGLE, u:DEPTH[:EXPONENT], ellipse:DEPTH, flat or file:PATH"
# least and most bins of angle across the scratch
BINS = (8, 512)
