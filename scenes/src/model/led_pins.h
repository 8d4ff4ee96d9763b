/// @file led_pins.h
/// Pins that move.
#pragma once

#include <string>

#include "model/model_faults.h"
#include "supple/scenes/model.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// Adds the motion of a pin to the model, with its speed and the distances that it reaches.
/// @param key  of the pin  @param pin  without its place
void add_led_pin(const Scene& scene, const PinDesc& d, const std::string& key, core::LedPin pin, Model& model, ModelFaults& faults);

/// Sorts the moving pins by particle; a fault where two lead one.
void sort_led_pins(const Scene& scene, Model& model, ModelFaults& faults);

/// Whether a pin moves its particle between two times.
[[nodiscard]] bool leads(const core::LedPin& pin, double from, double to);

}  // namespace supple::scenes
