"""Complex refractive indices by name, their projection to linear sRGB, and the Fresnel term that models take."""
