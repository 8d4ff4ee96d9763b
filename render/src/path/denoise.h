/// @file denoise.h
/// A filter that follows features: the edge-avoiding a-trous transform (Dammertz et al. 2010) of the light that falls on
/// each pixel (radiance over albedo), stopped by normals, tangent planes and differences above the estimated noise
/// (Schied et al. 2017). Direct and indirect light go apart; the second is stopped by distance, too, where other surfaces are
/// near, as it can change no faster than these allow (Ward & Heckbert 1992). A pixel where surfaces meet has the indirect light of each
/// of its facets from neighbours on the same surface.
#pragma once

#include "integrator.h"

namespace supple::render::path {

/// Replaces film.radiance. @param footprint  of a pixel at unit distance  @param eye  relative to the origin
void denoise(int width, int height, const Vec3f& eye, float footprint, const Executor& executor, Film& film);

}  // namespace supple::render::path
