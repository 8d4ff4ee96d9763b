/// @file fields_output.h
/// The keys of what a run leaves; see fields.h.
#pragma once

#include <algorithm>
#include <string>

#include "file/fields_rules.h"
#include "file/read_scene_faults.h"

namespace supple::scenes {

template <class Archive>
void fields(Archive& archive, ObjectMeshingDesc& d) {
  archive("cell", d.cell, above(0.0, kLength).or_auto(), "lattice cell of its meshes and grids; auto: as output.cell");
  archive("error", d.error, above(0.0, kLength).or_auto(), "as output.meshing.error, which it replaces");
}

template <class Archive>
void fields(Archive& archive, ImagesDesc& d) {
  archive("size", d.size, between(16.0, 16384.0, kNumber).items(2, 2), "width, height [pixel]");
  archive("samples", d.samples, between(1.0, 8.0, kNumber), "a pixel: 1, 2, 4 or 8");
  archive("formats", d.formats, {}, "exr: half floats, light before exposure and tone curve times cover, cover, depth, normals, velocities and numbers of objects");
  archive.check(!d.formats.empty(), "formats", "expected a format of images", "none", "write 'images: false' for no images");
  archive.check((d.samples & (d.samples - 1)) == 0, "samples", "expected 1, 2, 4 or 8", std::to_string(d.samples), "");
}

template <class Archive>
void fields(Archive& archive, MeshingDesc& d) {
  using enum MeshingName;
  const auto only = [&d](const Rule& rule) { return rule.only("method", d.method, {Delaunay}); };
  archive("method", d.method, {}, "of objects that touch no other (those that do are divided by tetrahedra, to the same error; delaunay refines what bounds them, too); auto: cubes or openvdb, whichever costs less by counts (cubes with an error), and vertices on the creases of blending graphs, which all other methods cut off within a cell; tetrahedra: vertices stay where a node of the lattice lies on the surface, several in one place, with triangles without area between them; openvdb: through a grid; delaunay: triangles of guaranteed quality, needs the component supple_cgal");
  archive("error", d.error, above(0.0, kLength).or_auto(), "largest distance of a triangle's centroid to the surface, for auto, cubes and where objects touch; chooses the cells, none above a stated 'cell', and is refused where what meets it does not fit (8 GB, 1e9 nodes around a body); auto: by the cell");
  archive("angle_deg", d.angle, only(degrees(1.0, 30.0)), "least angle of a triangle");
  archive("size", d.size, only(above(0.0, kLength).or_auto()), "largest radius of a ball through a triangle's corners around a point of the surface; auto: two cells");
  archive("distance", d.distance, only(above(0.0, kLength).or_auto()), "from a triangle's circumcentre to that point; auto: a tenth of the size");
  archive("search", d.search, Rule{}.or_auto(), "looks for cavities and islands between the nodes of the lattice and adds them, but not to bodies that touch others and bulge; never by way of a grid. true: all others, though it takes longer than the mesh itself where supports span few cells, bodies touch in many places or cells stay open; a warning counts what was found and where some may be missed still (where both ends of an arc, all of a ring or parts of a curve beside other shapes are as near as each other, blends by gradients, where three bodies meet). auto: those whose search takes by counts at most twice as long as the mesh, or next to nothing, and leaves no cells open along blends by gradients or tight bends of curves beside other shapes; 'search' in the report counts the others");
  archive("motion", d.motion, {}, "columns velocity_x, velocity_y, velocity_z [m/s] and owner (number of the particle) in mesh files as ply and usd; obj has none");
  archive.check(!d.error || d.method == Auto || d.method == Cubes, "error", "expected method auto or cubes with an error",
                std::string(name_of(d.method)), "leave out 'method'");
  archive.check(!d.search.value_or(false) || d.method == Auto || d.method == Cubes, "search", "expected method auto or cubes with a search",
                std::string(name_of(d.method)), "leave out 'method'");
}

template <class Archive>
void fields(Archive& archive, GriddingDesc& d) {
  archive("of", d.of, {}, "a grid of each object under its name, one of their union named 'scene', or both");
  archive("content", d.content, {}, "signed distance near the surface to first order, or the field");
  archive("half_width", d.half_width, between(1.0, 100.0, kNumber), "of the band on each side of the surface, in cells");
}

template <class Archive>
void fields(Archive& archive, SamplingDesc& d) {
  archive("spacing", d.spacing, above(0.0, kLength).or_auto(),
          "no two samples of an object are nearer than half of it, no place of its surface is farther than it from all; auto: four times output.cell");
  archive("density", d.density, above(0.0, kInverseArea), "instead: samples a square metre, to a tenth where the surface is smooth and at rest");
  archive.check(!(d.spacing && d.density), "density", "expected either spacing or density", "both", "");
}

template <class Archive>
void fields(Archive& archive, FilmDesc& d) {
  archive("frame_rate", d.frame_rate, between(0.1, 1000.0, kRate).or_auto(),
          "frames a second of the film; auto: the scene's; less is slow motion");
}

template <class Archive>
void fields(Archive& archive, OutputDesc& d) {
  archive("images", d.images, {}, "a PNG a frame");
  archive("film", d.film, {}, "an MP4 of the images, by ffmpeg; of one look: where frames lack a picture, or have one of another size or other keys, none is made, and an earlier one that shows others is removed");
  archive("contacts", d.contacts, {}, "points of the contact surfaces, and of every pair that touches force, area, energy and dissipation, a frame; vtk: .vtp files and a .pvd each");
  archive("particles", d.particles, {}, "particles and bonds a frame; vtk: .vtp files and a .pvd");
  archive("samples", d.samples, {}, "points spread evenly over the surfaces a frame, which ride on their particles: id, owner, normal and area; as if nothing touched; vtk: .vtp files and a .pvd");
  archive("mesh", d.mesh, {}, "surfaces; ply, obj: a file an object and frame; usd: one file with all frames");
  archive("grid", d.grid, {}, "fields a frame, as contact deforms them");
  archive("meshing", d.meshing, {}, "how surfaces become meshes");
  archive("gridding", d.gridding, {}, "how fields become grids");
  archive("sampling", d.sampling, {}, "how far apart samples are");
  archive("cell", d.cell, above(0.0, kLength).or_auto(), "lattice cell of meshes and grids of objects without 'meshing.cell'; auto: 8 cells across the smallest thickness of these, and for each at least 64 along the box of balls around the supports of its particles, of which its surface may fill a third");
  archive.check(!d.film || !d.images || std::count(d.images->formats.begin(), d.images->formats.end(), ImageName::Png) > 0, "film",
                "expected images as png for a film", "none", "add png to output.images.formats");
  archive.check(!d.film || d.images, "film", "expected images for a film", "none", "add 'images: true' under output");
}

}  // namespace supple::scenes
