"""Random walks on Smith microfacets: random numbers, visible normals, path terms, and the tables made of them."""
