"""Numbers by which kernels tell distributions and maskings apart; those of Fresnel terms are in `brdftab.materials`."""

# normal distributions; Gaussian: of the tilt, for ilm alone
BECKMANN, GGX, PHONG, GAUSSIAN = range(4)
NDF_CODES = {"beckmann": BECKMANN, "ggx": GGX, "phong": PHONG, "gaussian": GAUSSIAN}
# Smith's masking of light and view, as a product, for one height, or with Walter's rational fit; V-cavities
SEPARABLE, CORRELATED, WALTER = range(3)
V_CAVITY = 10
MASKINGS = {"separable": SEPARABLE, "height-correlated": CORRELATED, "smith-walter": WALTER}
