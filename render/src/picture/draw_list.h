/// @file draw_list.h
/// The content of a picture in the numbers of the graphics driver: packed vertices, matrices, fitted maps.
/// Lengths and positions are those of the picture (picture_space.h), so that single precision is used for visible parts.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "picture/picture_space.h"
#include "supple/render/view.h"

namespace supple::render {

/// The triangles of one item: a range of DrawList::indices.
struct DrawRange {
  std::size_t first = 0;
  std::size_t count = 0;
  std::size_t item = 0;  ///< index of the item it came from
};

/// All items in one vertex and one index array.
struct DrawList {
  std::vector<float> vertices;         ///< position and normal, shape [vertices][6]
  std::vector<float> paint;            ///< places in patterns or (value, 0, 0), shape [vertices][3]; empty without painted items
  std::vector<std::uint32_t> indices;  ///< shape [triangles][3]
  std::vector<DrawRange> ranges;       ///< items that have triangles, in their order
  Box bounds;                          ///< of all vertices
};

/// Fills `list`, reusing its capacity.
/// @pre every mesh has one normal per vertex, finite positions and valid indices; fewer than 2^32 vertices in all
void pack(std::span<const Item> items, const PictureSpace& space, DrawList& list);

struct CameraMatrices {
  Eigen::Matrix4f view;             ///< to eye; the eye looks along -z
  Eigen::Matrix4f view_projection;  ///< to clip, whose depth is near plane over depth: as precise far off as near by
  Eigen::Vector3f eye;
  Eigen::Vector2f half_extent;      ///< tangents of half the horizontal and half the vertical field of view
  Eigen::Vector2f depth_range;      ///< near plane, and the far limit of all items
  double distance = 0.0;            ///< from the eye to look_at
};

/// @throws Error{Usage} when the eye is at look_at or the field of view is not in (0, pi).
[[nodiscard]] CameraMatrices camera_matrices(const Camera& camera, double aspect, const Box& bounds);

/// An orthographic map of a box: u, v in [0, 1] across it and w in [0, 1] along the direction of view.
struct MapFit {
  Eigen::Matrix4f to_unit;  ///< to (u, v, w)
  Eigen::Matrix4f to_clip;  ///< the same in clip coordinates
  Eigen::Matrix4f axes;     ///< rows: the directions of u, v, w
  Eigen::Vector3f extent;   ///< of the box along u, v, w
};

/// The map of `bounds` along `direction`, `size` texels per edge. Its edges grow in steps and its corner lies on
/// whole texels, so that the map of a slowly changing box is constant and shadows do not move from frame to frame.
[[nodiscard]] MapFit fit_map(const Box& bounds, const Vec3& direction, int size);

/// The view of an area light, in perspective from its centre along `front`: u to the right. Tangents are lateral over depth.
struct AreaMap {
  Eigen::Matrix4f to_clip = Eigen::Matrix4f::Identity();  ///< to clip; depth is affine in 1 / depth
  Eigen::Vector3f lower = Eigen::Vector3f::Zero();        ///< least tangents; 1 / depth of the near plane
  Eigen::Vector3f extent = Eigen::Vector3f::Zero();       ///< of the tangents and of 1 / depth; 0: nothing is in view of the light
};

/// The map of the vertices before the light, of `size` texels an edge. Tangents beyond 4 are left out.
/// @param light     in the lengths of the picture  @param vertices  as DrawList::vertices
[[nodiscard]] AreaMap fit_area_map(const AreaLight& light, std::span<const float> vertices, int size);

/// Where the vertices of an item lie in its pattern, in cubes, slices or widths of it: by the columns rest_x, rest_y, rest_z, or in the
/// world; from a place near by at which the pattern begins anew.
/// @pre Checker, Stripes or Picture  @param item  in metres
[[nodiscard]] std::vector<Eigen::Vector3f> places_in_pattern(const Item& item);

/// The values of a column, or null.
[[nodiscard]] const std::vector<double>* column(const Mesh& mesh, std::string_view name);

/// Whether it is one of those that lie in space.
[[nodiscard]] bool has_pattern(const Paint& paint);

/// Whether the item's colour is not the same all over (or it is not all there), so that pixels must carry it.
[[nodiscard]] bool is_painted(const Item& item);

/// Halves of the edges of an area light: u horizontal, u x v where it shines.
struct RectangleEdges {
  Vec3 u;
  Vec3 v;
};
[[nodiscard]] RectangleEdges rectangle_edges(const AreaLight& light);

}  // namespace supple::render
