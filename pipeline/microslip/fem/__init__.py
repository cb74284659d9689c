"""Weak forms -> K, M, K_sigma, K_spin, G_gyro and loads, vectorised over elements.

scikit-fem supplies the shape functions and the quadrature; the contraction over all elements is one matrix
product per batch. The plain scikit-fem forms are the oracle in the tests.
"""
