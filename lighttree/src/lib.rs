//! Light trees and lightcuts: many lights, few shadow rays, a known error.
