//! Support shared by the whole-renderer tests.
