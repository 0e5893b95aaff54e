"""Measured data: what is there, and what can it tell?"""
