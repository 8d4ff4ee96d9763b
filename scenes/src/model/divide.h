/// @file divide.h
/// Before stages 9 and 11: division of space between bodies that touch.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "supple/collision/contact_surface.h"
#include "supple/core/executor.h"
#include "supple/implicit/field.h"
#include "supple/scenes/division.h"
#include "supple/scenes/mesh_search.h"
#include "supple/scenes/model.h"

namespace supple::scenes {

/// @param placed  all contact bodies  @param fields, surface  must outlive the result
[[nodiscard]] Division division_of(const Model& model, const std::vector<Body>& bodies, std::span<const implicit::Field> fields,
                                   std::span<const collision::ContactBody> placed, const collision::ContactSurface& surface, const Executor& executor);

/// Bulges of a division that hold too little volume, by objects. @param time  of the state [s]
[[nodiscard]] std::map<std::string, std::map<std::string, ShortBulges>> find_short_bulges(const Model& model, const std::vector<Body>& bodies, const Division& division,
                                                                                          double time);

}  // namespace supple::scenes
