"""Inverse dynamics: the torques of motors along a motion, of trees and of closed linkages."""
