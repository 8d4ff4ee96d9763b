// What a user reads when data cannot be fitted, word for word.
#include <gtest/gtest.h>

#include <fstream>

#include "fit/shapes.h"
#include "supple/core/error.h"
#include "supple/fit/fit.h"

namespace supple::fit {
namespace {

/// The message of a fit, from the name of the file on.
std::string message(const std::string& name, const std::string& text, const FitOptions& options = {}) {
  const std::filesystem::path path = temp_folder() / name;
  std::ofstream(path) << text;
  try {
    (void)fit(path, options);
  } catch (const Error& error) {
    const std::string what = error.what();
    const std::size_t at = what.find(name);
    return at == std::string::npos ? what : what.substr(at);
  }
  return "no fault";
}

std::string off(const std::string& vertices, const std::string& faces) {
  const auto lines = [](const std::string& s) { return std::to_string(std::count(s.begin(), s.end(), '\n')); };
  return "OFF\n" + lines(vertices) + ' ' + lines(faces) + " 0\n" + vertices + faces;
}

const std::string kTetrahedron = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";

TEST(FitRefuses, FilesThatAreNoMesh) {
  EXPECT_EQ(message("mesh.stp", "x"), "mesh.stp: expected a mesh (.ply, .obj, .off, .stl), points (.xyz, .ply) or a volume (.nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd, .vdb), found '.stp'; convert the data, or rename a file of another extension");
  EXPECT_EQ(message("wrong_header.off", "OFX 3 1 0\n0 0 0\n"), "wrong_header.off: expected a mesh, found text or bytes that are none, or that end early; the extension says how a file is read");
  EXPECT_EQ(message("cut_off.ply", "ply\nformat ascii 1.0\nelement vertex 3\n"), "cut_off.ply: expected 'end_header', found the end of the file");
  EXPECT_EQ(message("no_bytes.off", ""), "no_bytes.off: expected data, found an empty file; write it again");
  EXPECT_EQ(message("empty.off", "OFF\n0 0 0\n"), "empty.off: expected triangles, found none; points without faces are read from .xyz and .ply");
  EXPECT_EQ(message("large.off", "OFF\n4000000000 1 0\n0 0 0\n"), "large.off: expected a mesh, found text or bytes that are none, or that end early; the extension says how a file is read");
  try {
    (void)fit(temp_folder() / "wrong_heade.off");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Io);
    EXPECT_TRUE(std::string(error.what()).ends_with("wrong_heade.off: cannot be read: No such file or directory; did you mean 'wrong_header.off'?")) << error.what();
  }
}

TEST(FitRefuses, SurfacesWithoutInside) {
  EXPECT_EQ(message("open.off", off("0 0 0\n1 0 0\n1 1 0\n0 1 0\n", "3 0 1 2\n3 0 2 3\n")),
            "open.off: expected holes whose closing adds less than a tenth of the area, found 1 hole, the largest part at (1, 0, 0); close them in a mesh editor, or fit a surface without inside by --kind shell");
  EXPECT_EQ(message("flat.off", off("0 0 0\n1 0 0\n1 1 0\n0 1 0\n", "3 0 1 2\n3 0 2 3\n3 1 0 3\n3 1 3 2\n")),
            "flat.off: expected a mesh that encloses a volume, found a flat one; fit a surface without inside by --kind shell");
  const std::string plate = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 0.001\n1 0 0.001\n1 1 0.001\n0 1 0.001\n";
  EXPECT_EQ(message("plate.off", off(plate, "4 3 2 1 0\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n")),
            "plate.off: expected a mesh that encloses a volume, found one so thin that points 0.2605 % of the diagonal apart miss it; fit a surface without inside by --kind shell");
}

TEST(FitRefuses, ThreeTrianglesAtAnEdge) {
  EXPECT_EQ(message("manifold.off", off(kTetrahedron + "1 1 1\n0.5 -1 0\n", "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n3 0 1 5\n3 0 5 3\n3 5 1 3\n")),
            "manifold.off: expected at most two triangles at every edge, found 3 edges with more, one from (0, 0, 0) to (1, 0, 0); remove walls inside, or join the parts into one solid");
}

TEST(FitRefuses, SeveralPieces) {
  EXPECT_EQ(message("pieces.off", off(kTetrahedron + "5 0 0\n6 0 0\n5 1 0\n5 0 1\n", "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n3 4 6 5\n3 4 5 7\n3 5 6 7\n3 6 4 7\n")),
            "pieces.off: expected a mesh in one piece, found 2 pieces; choose the largest by --pieces largest, others by --pieces 2 and so on");
}

TEST(FitRefuses, OptionsOutOfRange) {
  EXPECT_EQ(message("any.off", "", {.error = 0.5}), "--error: expected a share of the diagonal from 0.1% to 10%, found 0.500000");
  EXPECT_EQ(message("any.off", "", {.particles = 0}), "--particles: expected a whole number from 1 to 10000, found 0");
  EXPECT_EQ(message("any.nii", "", {.volume = {.window = std::array{2.0, 1.0}}}), "--window: expected two values, the smaller one first, found 2:1");
  EXPECT_EQ(message("any.off", "", {.primitives = 20000}), "--primitives: expected a whole number from 1 to 10000, found 20000");
}

}  // namespace
}  // namespace supple::fit
