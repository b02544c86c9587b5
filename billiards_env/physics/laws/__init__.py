"""The laws of physics: one file each. A law is a kernel of the state before and the numbers of the scene.

`derivatives.tangent` makes the derivatives of the laws from their sources.
"""
