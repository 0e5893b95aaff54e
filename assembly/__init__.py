"""What pose, what energy, what error?"""
