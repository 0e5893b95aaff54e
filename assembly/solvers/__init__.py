"""The compiled and conic programmes under problems (21), (22) and (27)."""
