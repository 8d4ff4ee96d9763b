/// @file march_rule.h
/// Quadrature on any Sigma: tetrahedra over the overlap give plane triangles, each of which is mapped onto Sigma; Gauss points lie in
/// the part of the image where the pressure is positive, between rims that are found along parallel rays, and on both sides of the kinks
/// of the fields that cross it. Images are split where the sums of two rules differ most.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "numbers.h"
#include "surface/march/sigma_mesh.h"
#include "surface/pair_pressure.h"
#include "surface/patch_points.h"
#include "surface/polar/apex.h"

namespace supple::collision {

/// Error from which on coarser meshes and rules are enough: they meet it with room to spare.
inline constexpr double kCoarseError = 5e-4;

class MarchRuleSolver {
 public:
  struct Limits {
    double error;     ///< relative, asked for
    int refinements;  ///< times that pieces of images are split, at most
  };
  struct Job {
    PairPressure& pressure;
    Thirds third;  ///< bodies whose larger pressure takes space away from the pair
    Box overlap;
    Regions regions;  ///< what is wanted of the squeezed regions
    Vec3 reference;   ///< origin of the moments in `sums`
    std::optional<CommonAxis> axis;  ///< all around which both bodies, and no third, are the same: what is sideways to it cancels but for round-off
    Limits limits;
  };
  /// @return whether Sigma was met
  bool solve(const Job& job, PatchPoints& points);

  /// False: bounds of the fields leave no room for Sigma, but for what presses less than a tenth of what the softer body may there: surfaces in one place
  /// have no other one.
  static bool may_meet(const PairPressure& pressure, const Box& overlap);

  [[nodiscard]] const PatchSums& sums() const noexcept { return sums_; }
  [[nodiscard]] double estimate() const noexcept { return estimate_; }
  [[nodiscard]] double thickness() const noexcept { return thickness_; }  ///< about the point of largest pressure [m]

  /// Of images, all levels together: no more are split then.
  static constexpr std::size_t kMostPieces = 1u << 15;

 private:
  static constexpr double kFarOff = 0.02;  ///< off Sigma, in cells: too far to move along it
  /// A place of a triangle's image.
  struct Foot {
    Vec2 at = Vec2::Zero();     // (s, t): corners of the triangle are (0, 0), (1, 0), (0, 1)
    double height = 0.0;        // along the interpolated normal [m]
    double pressure = 0.0;      // of the pair, less that of third bodies where they press [Pa]
    Vec2 slope = Vec2::Zero();  // of this over s and t
    Vec2 climb = Vec2::Zero();  // of the height
    bool good = false;          // it was found, and the image is smooth there
  };
  /// A triangle within the parameters of a triangle of the mesh.
  struct Piece {
    std::uint32_t triangle = 0;
    std::array<Foot, 3> corner;
    std::array<Foot, 3> middle;  // of the edges, across from the corners
  };
  /// How the part that presses lies in a piece.
  enum class Part : std::uint8_t { None, All, Corner, AllButCorner };
  struct Shape {
    Part part = Part::None;
    std::array<std::size_t, 3> order{0, 1, 2};  // corners: the lone one, that at the end of its edge along which rays run, the last
    bool certain = true;
    double most = 0.0;     // the pressure is hardly more [Pa]
  };
  /// How far two rules of a leaf tell what they miss.
  enum class Trust : std::uint8_t { Smooth, Kinked, Lost };  // a kink is left uncut, or was not cut alike on all rays
  /// A piece with its sums.
  struct Leaf {
    Piece piece;
    Shape shape;
    PatchSums sums, off;       // by the finer rule, and what it differs from the coarser one by
    double doubt = 0.0;        // area that may be wrongly held or left out [m^2]
    double doubt_load = 0.0;   // [N]
    std::size_t begin = 0, end = 0;  // of its points
    double ends = 1.0;  // where the rim crosses the edge across the rays, of it
    std::size_t first_crossing = 0, crossings = 0;
    std::size_t first_break = 0, breaks = 0;
    Trust trust = Trust::Smooth;
    bool mild = true;  // second derivatives do not jump
    double error = 0.0;
    void add_doubt(double area) {
      doubt += area;
      doubt_load += area * shape.most;
    }
  };
  /// Places to be found: height, and everything after it, is out.
  struct Feet {
    std::vector<std::uint32_t> triangle;
    std::vector<Vec2> at;
    std::vector<double> height;
    PressureBatch batch;
    std::vector<double> third;
    std::vector<Vec3> third_slope;
    std::vector<Vec3> along_s, along_t;  // of the image [m]
    std::vector<Vec3> way;               // the interpolated normal, which is no unit vector
    std::vector<Vec2> climb;
    std::vector<std::uint8_t> met, good;  // Sigma was, and the image is smooth there
    void clear();
    void make_room();
    void add(std::uint32_t in, const Vec2& where, double guess);
    [[nodiscard]] std::size_t size() const noexcept { return at.size(); }
  };
  /// A point of the finer rule, with what columns through it need.
  struct Node {
    Vec3 point, normal, along;
    double weight, pressure, residual;
    std::array<double, 3> swept;  // area across `along` over the distance along it, as a polynomial
  };
  /// How far a squeezed region reaches along a node's way, between places on both sides of its end, and the area across it over that distance.
  struct Column {
    Vec3 way = Vec3::Zero();
    Swept swept{};
    double at = 0.0, low = 0.0, high = kInfinity;
  };
  /// A kink that may cross a leaf, by its s at the corners and at the middles of the edges.
  struct Crossing {
    std::size_t kink = 0;
    std::array<double, 6> side{};
  };
  /// Where a kink meets the rim of a leaf.
  struct Corner {
    std::size_t leaf, kink;
    bool found;
  };
  enum class Rim : std::uint8_t { None, Falls, Rises };  // how the pressure, or s of a kink, goes where a ray crosses its zero
  static constexpr std::size_t kPressure = std::numeric_limits<std::size_t>::max();
  /// A ray through a piece, and where on it the rim lies, or a kink.
  struct Ray {
    std::size_t leaf = 0;
    std::size_t kink = kPressure;  // that is sought
    int nodes = 0;
    bool fine = false;
    Vec2 from = Vec2::Zero(), way = Vec2::Zero();
    double exit = 1.0, weight = 0.0;
    Rim rim = Rim::None;
    double low = 0.0, high = 1.0, at = 0.0, height = 0.0;
    bool found = false;
    std::size_t first_cut = 0, cuts = 0;
    std::size_t part = 0;  // of its leaf, between breaks
    std::size_t feet = 0;
    [[nodiscard]] double begins() const noexcept { return rim == Rim::Rises ? at : 0.0; }
    [[nodiscard]] double ends() const noexcept { return rim == Rim::Falls ? at : exit; }
  };

  void find_tangents(Feet& feet, std::size_t i) const;
  [[nodiscard]] static bool upright(const Feet& feet, std::size_t i);
  void measure(PairPressure& pressure, Thirds third, Feet& feet, std::span<const std::size_t> which);
  void place(PairPressure& pressure, Thirds third, Feet& feet);
  [[nodiscard]] static double to_sigma(const Feet& feet, std::size_t i);
  static void lift(Feet& feet, std::size_t i, double move);
  [[nodiscard]] Vec3 plane(std::uint32_t triangle, const Vec2& at) const;
  [[nodiscard]] Vec3 along(std::uint32_t triangle, const Vec2& at) const;
  [[nodiscard]] double area_of(const Piece& piece) const;
  [[nodiscard]] Foot foot(const Feet& feet, std::size_t i) const;
  static double twice_parameters(const Piece& piece);
  /// What a quadratic polynomial through the corners and middles says of them.
  template <class Of>
  static double quadratic(const Piece& piece, const Vec2& at, const Of& of) {
    const std::array<double, 6> weight = weights(piece, at);
    double sum = 0.0;
    for (std::size_t k = 0; k < 3; ++k) sum += weight[k] * of(piece.corner[k]) + weight[3 + k] * of(piece.middle[k]);
    return sum;
  }
  /// Bezier controls of the cubic polynomial with the values and slopes of the pressure at the corners of a piece, and by how much it may miss the pressure.
  /// Rays run from corner i towards another one; `sign` is that of the pressure at i.
  struct Controls {
    std::array<double, 3> corner{};
    std::array<std::array<double, 3>, 3> edge{};  // [i][j]: next to corner i on the way to j
    double inner = 0.0, margin = 0.0, lowest = kInfinity, highest = -kInfinity;
    explicit Controls(const Piece& piece);
    [[nodiscard]] bool steady(std::size_t i, std::size_t to, double sign) const;
    [[nodiscard]] bool bends(std::size_t i, std::size_t to, double sign) const;
  };
  [[nodiscard]] Shape shape_of(const Piece& piece) const;
  [[nodiscard]] bool smooth(const Piece& piece, double error) const;
  [[nodiscard]] bool may_press(const PairPressure& pressure, const Piece& piece) const;
  bool lay_mesh(PairPressure& pressure, Thirds third, const Box& overlap, const std::optional<CommonAxis>& axis,
                const std::optional<FlatCells>& flat, double error);
  void begin(PairPressure& pressure, Thirds third, std::vector<Piece>& pieces);
  static std::optional<double> turn(const Piece& piece, std::size_t across);
  void find_turns(PairPressure& pressure, Thirds third, std::span<const Piece> from, bool any);
  void divide(const Piece& p, const std::array<std::optional<Foot>, 3>& turned, std::vector<std::array<Foot, 3>>& to) const;
  void split(PairPressure& pressure, Thirds third, std::span<const Piece> from, bool at_turns, std::vector<Piece>& to);
  void settle(PairPressure& pressure, Thirds third, double error, std::vector<Piece>& pieces);
  void guess(Ray& ray) const;
  static double height_at(const Piece& piece, const Vec2& at);
  static std::array<double, 6> weights(const Piece& piece, const Vec2& at);
  void cross_kinks(Leaf& leaf) const;
  void find_crossings(const PairPressure& pressure, std::size_t first, std::size_t end, double error);
  void add_cuts(const Ray& along, double low, double high, std::vector<Ray>& cuts) const;
  void guess_corners(std::size_t first, std::size_t end);
  void find_corners(PairPressure& pressure, Thirds third, std::size_t first, std::size_t end);
  void find_breaks(PairPressure& pressure, Thirds third, std::size_t first, std::size_t end);
  void find_cuts(PairPressure& pressure, Thirds third);
  bool sides_agree(const Leaf& leaf, std::size_t first_ray, std::size_t end_ray, std::size_t foot);
  void find_ends(PairPressure& pressure, Thirds third, std::size_t first, std::size_t end);
  void send_rays(std::size_t first, std::size_t end, int order);
  void find_zeros(PairPressure& pressure, Thirds third, std::vector<Ray>& rays);
  void lay_points();
  [[nodiscard]] Node node_at(std::size_t i) const;
  void integrate(PairPressure& pressure, Thirds third, const Vec3& reference, double error, std::size_t first);
  static double share_of(const Leaf& leaf, int order);
  void weigh(int order);
  bool refine(PairPressure& pressure, Thirds third, const Limits& limits, const Vec3& reference);
  void start_columns(PairPressure& pressure, int side, const Node& peak);
  [[nodiscard]] bool lead_out() const;
  bool hold(PairPressure& pressure, int side);
  void add_columns(PairPressure& pressure, int side, double error, const Node& peak, PatchPoints& points);

  SigmaMesher mesher_;
  SigmaMesh mesh_;
  double cell_ = 0.0;
  double on_sigma_ = 0.0;  // in cells: a last step that may be left
  Feet feet_;
  PressureBatch some_;
  std::vector<double> value_, third_, share_;
  std::vector<Vec3> slope_, place_;
  std::vector<std::size_t> open_;
  FirstCome edges_;  // of the mesh: both vertices
  std::vector<std::uint8_t> rough_;   // triangles of long cells, or of too many, that are not smooth: between their corners Sigma may turn
  std::vector<std::size_t> spots_;    // of its triangles: six feet each
  std::vector<Piece> pieces_, halves_, doubtful_;
  std::vector<std::array<Foot, 3>> divided_;
  std::vector<std::array<std::optional<Foot>, 3>> turns_;  // on the edges across from the corners of pieces that are split
  std::vector<Leaf> leaves_;
  std::vector<implicit::Kink> kinks_, known_;  // of the overlap, of a leaf
  bool all_kinks_ = true;  // of the overlap; else those of leaves may be
  std::vector<Crossing> crossings_;
  std::vector<Corner> corners_;
  std::vector<double> breaks_;
  std::vector<std::uint8_t> sides_;
  std::vector<std::vector<std::uint8_t>> part_sides_;
  std::vector<Ray> rays_, cuts_;
  std::vector<Node> nodes_, kept_;
  std::vector<Column> columns_;
  std::optional<Apex> apex_;  // that they come out of
  std::vector<std::uint32_t> order_;
  PatchSums sums_;
  double estimate_ = 1.0, unmet_ = 1.0;  // the same, and by how much it is missed where that is more than all
  double thickness_ = 0.0;
};

}  // namespace supple::collision
