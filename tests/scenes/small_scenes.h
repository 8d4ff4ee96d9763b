/// @file tests/scenes/small_scenes.h
/// Scenes that several tests run.
#pragma once

namespace supple::scenes::small {

/// Two drops, of which the left one flies into the right one, and a camera; without title, duration and output.
inline constexpr const char* kTwoDrops = R"(
schema: 1
frame_rate: 8
objects:
  - name: left
    particles: {arrange: single, at: [-0.3, 0, 0], velocity: [1, 0, 0], mass: 0.5}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
    contact: {modulus: 2e3}
  - name: right
    particles: {arrange: single, at: [0.3, 0, 0], mass: 0.5}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
    contact: {modulus: 2e3}
camera: {from: [0, -3, 1], look_at: [0, 0, 0]}
)";

/// A chain whose steps are fifty periods long: no frame after the first few can be reached. Keys of the chain may follow.
inline constexpr const char* kUnstable = R"(
schema: 1
duration: 10 s
frame_rate: 10
time_step: {size: 0.1 s, substeps: 1}
objects:
  - name: chain
    particles: {arrange: line, count: 3, spacing: 0.2, spin: [0, 0, 3], mass: 0.01}
    interactions: [{law: bond_frame, stretch: 1e6, rotation: 10}]
)";

}  // namespace supple::scenes::small
