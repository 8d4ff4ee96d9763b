/// @file geometry.h
/// The triangles of a picture in Embree: first hits of rays, and their materials.
#pragma once

#include <embree3/rtcore.h>

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "path/bsdf.h"
#include "picture/picture_space.h"
#include "supple/render/view.h"

namespace supple::render::path {

/// Where a ray met an item. It begins empty, as eight are made for every bundle.
struct Hit {
  float distance;
  Vec3f point;        ///< of the triangle, in the picture's space
  Vec3f face_normal;  ///< unit, of the triangle, towards the ray
  Vec3f normal;       ///< unit, smooth, of the field where the item has one
  Vec3f leave;        ///< where paths go on: outside of the smooth surface (Hanika 2021) and clear of the triangle's rounding
  Vec3f pass;         ///< where those go on that pass through the surface
  bool back;          ///< met from inside of its body
  bool wire;          ///< of an edge of a wireframe
  Bsdf bsdf;
  std::uint32_t item;
};

/// Rays that are followed together; `time` in [0, 1] of the exposure.
struct RayBundle {
  Vec3Lanes from, direction;
  Lanes time;
  LaneMask who;           ///< lanes that hold a ray
  LaneBits inside{};      ///< 1 + the item that a ray is inside of, whose back faces it meets; 0: none
  bool together = false;  ///< they start near each other and go the same way
};

/// What light does inside an item, in lengths of the picture.
struct Medium {
  InsideKind kind = InsideKind::Opaque;
  float index = 1.5F;             ///< Glass
  float mean_free_path = 1.0F;    ///< Scatter
  Vec3f absorption = Vec3f::Zero();  ///< Glass: per length
};

/// How far from a face rays leave it, so that its own rounding does not stop them: a point of it is as far off as a few roundings of the
/// largest coordinate of its corners (Waechter & Binder 2019). No length is built in, so scenes may have any size.
template <class Number>
[[nodiscard]] Number clearance(Number largest_coordinate) {
  constexpr float kRoundings = 0x1p-16F;  // 256 of them
  return kRoundings * largest_coordinate;
}

class Geometry {
 public:
  Geometry();
  ~Geometry();
  Geometry(const Geometry&) = delete;
  Geometry& operator=(const Geometry&) = delete;

  /// Takes over the items of a picture. The hierarchy of an item is kept where nothing moved, refitted where its vertices did, and built
  /// anew where its triangles are others or have left each other; no picture depends on that.
  /// @param shutter  how long the picture is exposed [s]: vertices move by the columns velocity_x, velocity_y, velocity_z
  /// @param wire     radius of the edges of wireframes over their distance
  void set(std::span<const Item> items, const PictureSpace& space, double shutter, float wire);

  /// @param time    in [0, 1] of the exposure
  /// @param choice  uniform, decides about opacity
  /// @param exact   move the hit onto the field's surface
  [[nodiscard]] bool meet(const Vec3f& from, const Vec3f& direction, float time, float choice, bool exact, Hit& hit) const;
  /// Where a ray inside an item leaves it. @param reach  no farther than this
  [[nodiscard]] bool leave(std::uint32_t item, const Vec3f& from, const Vec3f& direction, float time, float reach, Hit& hit) const;
  /// Share of light that glass lets pass straight on: refraction is left out, and with it caustics.
  [[nodiscard]] Vec3f passed_by_glass(const Vec3f& from, const Vec3f& direction, float time, float distance) const;
  [[nodiscard]] const Medium& medium(std::uint32_t item) const { return media_[item]; }
  /// Whether light goes into some of the items.
  [[nodiscard]] bool has_media() const { return has_media_; }
  [[nodiscard]] bool has_glass() const { return has_glass_; }
  [[nodiscard]] bool blocked(const Vec3f& from, const Vec3f& direction, float distance, float time) const;
  /// The same for every ray of a bundle; the distance to a light is infinite.
  [[nodiscard]] LaneMask meet(const RayBundle& rays, Lanes choice, bool exact, std::array<Hit, kLanes>& hits) const;
  [[nodiscard]] LaneMask blocked(const RayBundle& rays) const;
  /// @param distance  to the light
  [[nodiscard]] LaneMask blocked(const RayBundle& rays, Lanes distance) const;

  /// Hierarchies of items in the last `set`: new, with vertices that moved, as they were.
  struct Counts {
    int built = 0, refitted = 0, kept = 0;
  };
  [[nodiscard]] const Counts& counts() const { return counts_; }

 private:
  struct Part;
  struct Crossing;
  struct Query;
  [[nodiscard]] LaneMask cross_bounds(const RayBundle& rays) const;
  [[nodiscard]] std::array<Crossing, kLanes> crossed(const RayBundle& rays) const;
  [[nodiscard]] Crossing crossed(const Vec3f& from, const Vec3f& direction, float time, float near_end, float far_end = INFINITY) const;
  void move_to_vertex(const Vec3f& from, const Vec3f& direction, float time, Crossing& crossing, bool& back) const;
  struct Ray {
    Vec3f from, direction;
    float time, choice;
    bool exact;
    std::uint32_t inside;  ///< 1 + the item it is inside of
  };
  [[nodiscard]] bool first_visible(Crossing crossing, const Ray& ray, Hit& hit) const;
  void refine(const Item& item, const Vec3f& direction, Hit& hit) const;

  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  std::vector<std::unique_ptr<Part>> parts_;  ///< of each item
  std::vector<Item> items_;
  std::vector<Medium> media_;  ///< of each item
  bool has_media_ = false, has_glass_ = false;
  PictureSpace space_;
  Vec3f lower_ = Vec3f::Zero(), upper_ = Vec3f::Zero();  ///< of the box of all items
  Vec3f centre_ = Vec3f::Zero();  ///< of the ball of all items
  float radius_ = 0.0F;
  float wire_ = 0.0F;
  bool scene_is_new_ = true;
  bool committing_ = false;  ///< and still so after a commit that failed
  Counts counts_;
};

}  // namespace supple::render::path
