/// @file fields_output.h
/// The keys of the outputs of a run; see fields.h.
#pragma once

#include <algorithm>
#include <string>

#include "file/fields/fields_rules.h"
#include "file/read_scene_faults.h"

namespace supple::scenes {

template <class Archive>
void fields(Archive& archive, ObjectMeshingDesc& d) {
  archive("cell", d.cell, above(0.0, kLength).or_auto(), "lattice cell of this object's meshes and grids; auto: output.cell");
  archive("error", d.error, above(0.0, kLength).or_auto(), "instead of output.meshing.error");
}

template <class Archive>
void fields(Archive& archive, ImagesDesc& d) {
  archive("size", d.size, between(16.0, 16384.0, kNumber).items(2, 2), "width, height [pixel]");
  archive("samples", d.samples, between(1.0, 8.0, kNumber), "per pixel: 1, 2, 4 or 8");
  archive("formats", d.formats, {}, "exr: half floats of linear light (before exposure and tone curve, premultiplied by coverage), coverage, depth, normals, velocities and object numbers");
  archive.check(!d.formats.empty(), "formats", "expected a format of images", "none", "write 'images: false' for no images");
  archive.check((d.samples & (d.samples - 1)) == 0, "samples", "expected 1, 2, 4 or 8", std::to_string(d.samples), "");
}

template <class Archive>
void fields(Archive& archive, MeshingDesc& d) {
  using enum MeshingName;
  const auto only = [&d](const Rule& rule) { return rule.only("method", d.method, {Delaunay}); };
  archive("method", d.method, {}, "isosurface extraction for objects that touch no other; objects that touch are meshed together by tetrahedra, to the same error (delaunay also refines their meshes). auto: cubes or openvdb, whichever has the lower estimated cost (cubes if 'error' is given), with vertices on the creases of blending graphs, which all other methods cut off within a cell; tetrahedra: keeps vertices at lattice nodes on the surface, where several can coincide, with triangles of no area between them; openvdb: from a grid; delaunay: triangles of guaranteed quality, needs the component supple_cgal");
  archive("error", d.error, above(0.0, kLength).or_auto(), "largest distance from the centroid of a triangle to the surface, for auto, cubes and objects that touch. It sets the cells, at most 'cell' if that is given; a scene whose meshes need more than 8 GB or 1e9 lattice nodes around a body is refused; auto: the cell sets the error");
  archive("angle_deg", d.angle, only(degrees(1.0, 30.0)), "smallest angle of a triangle");
  archive("size", d.size, only(above(0.0, kLength).or_auto()), "largest radius of the ball through the corners of a triangle whose centre is on the surface; auto: two cells");
  archive("distance", d.distance, only(above(0.0, kLength).or_auto()), "largest distance from the circumcentre of a triangle to the centre of that ball; auto: a tenth of 'size'");
  archive("search", d.search, Rule{}.or_auto(), "searches for cavities and islands between the nodes of the lattice and adds them to the mesh. Meshes by openvdb and bodies that touch others and bulge are not searched. true: searches all others, which takes longer than meshing where supports span few cells, bodies touch in many places or cells stay undecided; a warning counts the pieces found and the cells that stay undecided (points as near to both ends of an arc, to all of a ring or to several parts of a curve beside other shapes, blends by gradients, places where three bodies meet). auto: searches meshes whose search has an estimated cost of at most twice the meshing, or next to none, and leaves no cell undecided along blends by gradients or tight bends of curves beside other shapes; 'search' in the report counts the meshes that are not searched");
  archive("motion", d.motion, {}, "columns velocity_x, velocity_y, velocity_z [m/s] and owner (number of the particle) in ply and usd files; obj has none");
  archive.check(!d.error || d.method == Auto || d.method == Cubes, "error", "expected method auto or cubes with an error",
                std::string(name_of(d.method)), "leave out 'method'");
  archive.check(!d.search.value_or(false) || d.method == Auto || d.method == Cubes, "search", "expected method auto or cubes with a search",
                std::string(name_of(d.method)), "leave out 'method'");
}

template <class Archive>
void fields(Archive& archive, GriddingDesc& d) {
  archive("of", d.of, {}, "one grid per object under its name, one grid of their union named 'scene', or both");
  archive("content", d.content, {}, "signed distance near the surface to first order, or the field");
  archive("half_width", d.half_width, between(1.0, 100.0, kNumber), "of the narrow band on each side of the surface, in cells");
}

template <class Archive>
void fields(Archive& archive, SamplingDesc& d) {
  archive("spacing", d.spacing, above(0.0, kLength).or_auto(),
          "no two samples of an object are closer than half of this, and no point of its surface is farther than this from the nearest sample; auto: four times output.cell");
  archive("density", d.density, above(0.0, kInverseArea), "instead of spacing: samples per square metre, within a tenth where the surface is smooth and at rest");
  archive.check(!(d.spacing && d.density), "density", "expected either spacing or density", "both", "");
}

template <class Archive>
void fields(Archive& archive, FilmDesc& d) {
  archive("frame_rate", d.frame_rate, between(0.1, 1000.0, kRate).or_auto(),
          "frames per second of the film; auto: frame_rate of the scene; a lower rate is slow motion");
}

template <class Archive>
void fields(Archive& archive, OutputDesc& d) {
  archive("images", d.images, {}, "one picture per frame");
  archive("film", d.film, {}, "an MP4 film of the images, encoded by ffmpeg. If a frame has no picture, or one of another size or drawn with other keys, no film is made, and an earlier film of other pictures is removed");
  archive("contacts", d.contacts, {}, "tables per frame: quadrature points of the contact surfaces, and force, area, energy and dissipation of every pair in contact; vtk: .vtp files and a .pvd for each");
  archive("particles", d.particles, {}, "tables per frame: particles and bonds; vtk: .vtp files and a .pvd");
  archive("samples", d.samples, {}, "tables per frame: points spread evenly over the surfaces (without their deformation by contact) that move with their particles, with id, owner, normal and area; vtk: .vtp files and a .pvd");
  archive("mesh", d.mesh, {}, "meshes of the surfaces; ply, obj: one file per object and frame; usd: one file with all frames");
  archive("grid", d.grid, {}, "grids of the fields, deformed by contact, one file per frame");
  archive("meshing", d.meshing, {}, "how surfaces are meshed");
  archive("gridding", d.gridding, {}, "how fields are sampled on grids");
  archive("sampling", d.sampling, {}, "spacing of the samples");
  archive("cell", d.cell, above(0.0, kLength).or_auto(), "lattice cell of meshes and grids of objects without 'meshing.cell'; auto: 8 cells across the smallest thickness of these objects, and for each object at least 64 along the bounding box of the balls around the supports of its particles (its surface may fill a third of that box)");
  archive.check(!d.film || !d.images || std::count(d.images->formats.begin(), d.images->formats.end(), ImageName::Png) > 0, "film",
                "expected images as png for a film", "none", "add png to output.images.formats");
  archive.check(!d.film || d.images, "film", "expected images for a film", "none", "add 'images: true' under output");
}

}  // namespace supple::scenes
