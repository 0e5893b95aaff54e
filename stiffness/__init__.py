"""How stiff is a link?"""
