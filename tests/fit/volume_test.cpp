// Volumes as data: a ball of voxels in each format, what is chosen of it, and what is refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "fit/shapes.h"
#include "fit/surface.h"
#include "supple/core/error.h"
#include "supple/fit/fit.h"
#include "supple/implicit/field.h"
#include "supple/implicit/surface_grid.h"

namespace supple::fit {
namespace {

constexpr std::array<int, 3> kCount{30, 26, 22};
const Vec3 kSpacing(2.0, 2.5, 3.0), kFirst(10.0, -20.0, 30.0);  // [mm]
constexpr double kRadius = 20.0;                                // [mm]

Vec3 middle() { return kFirst + 0.5 * kSpacing.cwiseProduct(Vec3(kCount[0] - 1, kCount[1] - 1, kCount[2] - 1)); }

/// Distance inside the ball in tenths of a millimetre.
std::vector<std::int16_t> ball() {
  std::vector<std::int16_t> out;
  for (int k = 0; k < kCount[2]; ++k) {
    for (int j = 0; j < kCount[1]; ++j) {
      for (int i = 0; i < kCount[0]; ++i) out.push_back(static_cast<std::int16_t>(std::lround(10.0 * (kRadius - (kFirst + kSpacing.cwiseProduct(Vec3(i, j, k)) - middle()).norm()))));
    }
  }
  return out;
}

template <class T>
std::string bytes_of(const std::vector<T>& values, bool swap = false) {
  std::string out;
  for (const T& value : values) {
    std::string one(reinterpret_cast<const char*>(&value), sizeof(T));
    if (swap) std::reverse(one.begin(), one.end());
    out += one;
  }
  return out;
}

std::filesystem::path written(const std::string& name, const std::string& content) {
  const std::filesystem::path path = temp_folder() / name;
  std::ofstream(path, std::ios::binary) << content;
  return path;
}

const std::string kNrrd =
    "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 30 26 22\nspace directions: (2,0,0) (0,2.5,0) (0,0,3)\nspace origin: (10,-20,30)\n"
    "space units: \"mm\" \"mm\" \"mm\"\nendian: little\nencoding: raw\n";
const std::string kMeta = "ObjectType = Image\nNDims = 3\nDimSize = 30 26 22\nElementType = MET_SHORT\nElementSpacing = 2 2.5 3\nOffset = 10 -20 30\n";

std::string nifti(float slope = 0.0F) {
  std::string head(352, '\0');
  const auto put = [&head](std::size_t at, auto value) { std::copy_n(reinterpret_cast<const char*>(&value), sizeof(value), head.begin() + static_cast<std::ptrdiff_t>(at)); };
  put(0, std::int32_t{348});
  const std::array<std::int16_t, 8> dim{3, 30, 26, 22, 1, 1, 1, 1};
  const std::array<float, 8> pixdim{1, 2, 2.5F, 3, 1, 1, 1, 1};
  for (std::size_t k = 0; k < 8; ++k) {
    put(40 + 2 * k, dim[k]);
    put(76 + 4 * k, pixdim[k]);
  }
  put(70, std::int16_t{4});
  put(72, std::int16_t{16});
  put(108, 352.0F);
  put(112, slope);
  put(123, char{2});
  put(254, std::int16_t{1});
  const std::array<float, 12> rows{2, 0, 0, 10, 0, 2.5F, 0, -20, 0, 0, 3, 30};
  for (std::size_t k = 0; k < 12; ++k) put(280 + 4 * k, rows[k]);
  head.replace(344, 3, "n+1");
  return head;
}

/// A stream of zlib that stores bytes as they are.
std::string stored(const std::string& bytes) {
  std::string out = "\x78\x01";
  std::uint32_t a = 1, b = 0;
  for (const char c : bytes) {
    a = (a + static_cast<unsigned char>(c)) % 65521;
    b = (b + a) % 65521;
  }
  constexpr std::size_t kMost = 65535;
  for (std::size_t at = 0; at < bytes.size(); at += kMost) {
    const std::string part = bytes.substr(at, kMost);
    const auto n = static_cast<std::uint16_t>(part.size());
    out += at + kMost >= bytes.size() ? '\1' : '\0';
    out += bytes_of(std::vector<std::uint16_t>{n, static_cast<std::uint16_t>(~n)}) + part;
  }
  return out + bytes_of(std::vector<std::uint32_t>{(b << 16) | a}, true);
}

const VolumeOptions kInside{.iso = 0.0};

Mesh read(const std::filesystem::path& file, const FitOptions& options, Repair& repair) { return read_surface(file, options, repair, Executor(2)); }

/// Volume and middle are those of the ball [m].
void expect_ball(const std::filesystem::path& file, const VolumeOptions& volume = kInside, double radius = kRadius) {
  Repair repair;
  const MeshReport report = inspect(read(file, {.error = 0.01, .volume = volume}, repair));
  EXPECT_TRUE(report.closed);
  EXPECT_NEAR(report.volume / (4.0 / 3.0 * std::numbers::pi * std::pow(1e-3 * radius, 3)), 1.0, 0.02) << file;
  Box box;
  for (const Vec3& p : read(file, {.error = 0.01, .volume = volume}, repair).position) box.include(p);
  EXPECT_LT((box.centre() - 1e-3 * middle()).norm(), 1e-3) << file;
  EXPECT_EQ(repair.voxels, 30U * 26U * 22U);
  EXPECT_EQ(repair.pieces, 1U);
  EXPECT_FALSE(repair.cut);
}

/// The message of what is refused, from the name of the file on.
std::string message(const std::filesystem::path& file, const FitOptions& options = {.volume = kInside}) {
  Repair repair;
  try {
    (void)read(file, options, repair);
  } catch (const Error& error) {
    const std::string what = error.what(), name = file.filename().string();
    return what.substr(std::min(what.find(name), what.size() - 1));
  }
  return "no fault";
}

/// Of a format whose library a build may lack: whether it is there. Where it is not, the file is refused with the name of its package.
bool has_reader(const std::filesystem::path& file, const std::string& package) {
  const std::string what = message(file);
  if (what.find("without which this program was built") == std::string::npos) return true;
  EXPECT_TRUE(what.ends_with("install " + package + " and build it again")) << what;
  return false;
}

TEST(FitVolume, ReadsNrrd) {
  const auto file = written("ball.nrrd", kNrrd + '\n' + bytes_of(ball()));
  if (!has_reader(file, "libteem-dev")) return;
  expect_ball(file);
  written("ball.raw", std::string(7, 'x') + bytes_of(ball()));
  expect_ball(written("detached.nhdr", kNrrd + "byte skip: 7\ndata file: ball.raw\n"));
  EXPECT_EQ(message(written("header.nrrd", "NRRD0004\ntype: shot\n\n")), "header.nrrd: expected a header of NRRD and the data file that it names, found none that can be read; teem says: couldn't parse type \"shot\"");
  const std::string absent = message(written("absent.nhdr", kNrrd + "data file: absent.raw\n"));
  EXPECT_TRUE(absent.starts_with("absent.nhdr: expected a header of NRRD and the data file that it names, found none that can be read; teem says: couldn't open")) << absent;
  EXPECT_NE(absent.find("absent.raw\" (data file 1 of 1)"), std::string::npos) << absent;
  EXPECT_EQ(message(written("large.nhdr", "NRRD0004\ntype: short\ndimension: 3\nsizes: 1000 1000 1000\nendian: little\nencoding: raw\ndata file: large.nhdr\n")),
            "large.nhdr: expected at most 4e+08 voxels, found 1000 x 1000 x 1000; crop the volume, or make it coarser");
  EXPECT_EQ(message(written("short.nrrd", kNrrd + '\n' + bytes_of(ball()).substr(100))),
            "short.nrrd: expected the voxels that the header tells of, found fewer, or others; teem says: fread got only 17110 2-sized things, not 17160 (99.7086% of expected)");
}

TEST(FitVolume, ReadsNifti) {
  const auto file = written("ball.nii", nifti() + bytes_of(ball()));
  if (!has_reader(file, "libnifti-dev")) return;
  expect_ball(file);
  expect_ball(written("scaled.nii", nifti(0.1F) + bytes_of(ball())), {.iso = 2.0}, kRadius - 2.0);  // values in millimetres
  EXPECT_EQ(message(written("header.nii", "no header")), "header.nii: expected a header of NIfTI-1, found text or bytes that are none, or that end early; the extension says how a file is read");
  EXPECT_EQ(message(written("short.nii", nifti() + bytes_of(ball()).substr(100))),
            "short.nii: expected the voxels that the header tells of, found text or bytes that are none, or that end early; the extension says how a file is read");
}

/// Of gzip (CRC-32).
std::uint32_t checksum_of(const std::string& bytes) {
  std::uint32_t sum = ~0U;
  for (const char c : bytes) {
    sum ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) sum = (sum >> 1) ^ ((sum & 1) != 0 ? 0xedb88320U : 0U);
  }
  return ~sum;
}

TEST(FitVolume, ReadsCompressedNifti) {
  const std::string bytes = nifti() + bytes_of(ball());
  const std::string head("\x1f\x8b\x08\0\0\0\0\0\0\0", 10), packed = stored(bytes), body = packed.substr(2, packed.size() - 6);
  const auto tail = [](std::uint32_t checksum, std::size_t size) { return bytes_of(std::vector<std::uint32_t>{checksum, static_cast<std::uint32_t>(size)}); };
  const auto file = written("ball.nii.gz", head + body + tail(checksum_of(bytes), bytes.size()));
  if (!has_reader(file, "libnifti-dev")) return;
  expect_ball(file);
  EXPECT_EQ(message(written("short.nii.gz", head + body)),
            "short.nii.gz: expected the voxels that the header tells of, found text or bytes that are none, or that end early; the extension says how a file is read");
}

TEST(FitVolume, ReadsMetaImage) {
  expect_ball(written("ball.mha", kMeta + "ElementDataFile = LOCAL\n" + bytes_of(ball())));
  expect_ball(written("packed.mha", kMeta + "CompressedData = True\nElementDataFile = LOCAL\n" + stored(bytes_of(ball()))));
  written("big.raw", "header" + bytes_of(ball(), true));
  expect_ball(written("big.mhd", kMeta + "BinaryDataByteOrderMSB = True\nHeaderSize = -1\nElementDataFile = big.raw\n"));
  EXPECT_EQ(message(written("header.mha", "NDims = 3\nDimSize 30\n")), "header.mha:2: expected lines of a MetaImage header, Key = Value, up to ElementDataFile, found 'DimSize 30'; write the header again, its last line is ElementDataFile = FILE or LOCAL");
  EXPECT_EQ(message(written("type.mha", "DimSize = 3 3 3\nElementType = MET_LONG\nElementDataFile = LOCAL\n")), "type.mha: expected an ElementType from MET_CHAR to MET_DOUBLE, found 'MET_LONG'; convert the voxels to MET_FLOAT");
  EXPECT_EQ(message(written("numbers.mha", "DimSize = 3 3\nElementType = MET_SHORT\nElementDataFile = LOCAL\n")), "numbers.mha: expected 3 numbers after DimSize, found '3 3'; one for each axis");
  EXPECT_EQ(message(written("short.mha", kMeta + "ElementDataFile = LOCAL\nxy")), "short.mha: expected 34320 bytes of voxels, found 2; copy the file again, or correct DimSize and ElementType");
  EXPECT_EQ(message(written("large.mha", "DimSize = 1000 1000 1000\nElementType = MET_SHORT\nElementDataFile = LOCAL\n")),
            "large.mha: expected at most 4e+08 voxels, found 1000 x 1000 x 1000; crop the volume, or make it coarser");
  EXPECT_EQ(message(written("flat.mha", "DimSize = 3 3 3\nElementType = MET_UCHAR\nElementSpacing = 1 1 0\nElementDataFile = LOCAL\n")),
            "flat.mha: expected distances of voxels above 0 along axes that do not lie in a plane, found 0.001, 0.001, 0 m");
}

TEST(FitVolume, ReadsLevelSetsOfOpenVdb) {
  implicit::Skeleton skeleton;
  skeleton.part_count = 1;
  implicit::Primitive primitive;
  primitive.kernel = implicit::Kernel::wyvill(1.0);
  skeleton.primitive = {primitive};
  const std::vector<Pose> poses(1);
  implicit::PlacedSkeleton placed;
  implicit::place_skeleton(skeleton, poses, placed);
  implicit::Field field;
  implicit::index_field(skeleton, placed, field);
  implicit::GridOptions options;
  options.lattice = {Vec3::Constant(0.01), 0.05};
  std::vector<implicit::SurfaceGrid> grids;
  grids.push_back(implicit::make_surface_grid(field, options, Executor(1)));
  const auto file = temp_folder() / "ball.vdb";
  implicit::write_grids(file, grids);
  Repair repair;
  const MeshReport report = inspect(read(file, {}, repair));
  constexpr double kIsoRadius = 0.4542;  // of a lone point
  EXPECT_NEAR(report.volume / (4.0 / 3.0 * std::numbers::pi * std::pow(kIsoRadius, 3)), 1.0, 0.02);
  EXPECT_EQ(repair.cavities, 0U);
  EXPECT_EQ(message(written("no.vdb", "no grid"), {}), "no.vdb: expected a file of OpenVDB, found bytes that are none, or that end early; the extension says how a file is read");
}

TEST(FitVolume, ChoosesByWindowAndLabel) {
  const std::string head = kMeta + "ElementDataFile = LOCAL\n";
  const auto file = written("shells.mha", head + bytes_of(ball()));
  expect_ball(file, {.window = std::array{50.0, 1000.0}}, kRadius - 5.0);
  Repair repair;
  const FitOptions shell{.error = 0.01, .volume = {.window = std::array{20.0, 120.0}}};
  EXPECT_NEAR(inspect(read(file, shell, repair)).volume / (4.0 / 3.0 * std::numbers::pi * std::pow(0.018, 3)), 1.0, 0.02);  // filled
  EXPECT_EQ(repair.cavities, 1U);
  std::vector<std::int16_t> labels;
  for (const std::int16_t v : ball()) labels.push_back(v > 0 ? 7 : v > -50 ? 3 : 0);
  expect_ball(written("labels.mha", head + bytes_of(labels)), {.label = 7});
  EXPECT_EQ(message(file, {}),
            "shells.mha: expected one of --iso VALUE, --window FROM:TO and --label NUMBER, which say what lies inside, found none; values are -330 to 178");
  EXPECT_EQ(message(file, {.volume = {.iso = 500.0}}), "shells.mha: expected voxels of values above 500, found none; values are -330 to 178");
  EXPECT_EQ(message(file, {.volume = {.iso = -500.0}}), "shells.mha: expected voxels outside, too, found all of them of values above -500; values are -330 to 178");
  EXPECT_EQ(message(file, {.volume = {.label = 999}}), "shells.mha: expected voxels of label 999, found none; values are -330 to 178");
}

TEST(FitVolume, KeepsTheLargestPieceAndTellsWhereItIsCut) {
  std::vector<std::int16_t> values = ball();
  for (std::size_t k = 0; k < 3; ++k) values[k] = 100;  // in a corner
  const auto file = written("pieces.mha", kMeta + "ElementDataFile = LOCAL\n" + bytes_of(values));
  EXPECT_EQ(message(file), "pieces.mha: expected voxels in one piece, found 2 pieces; choose the largest by --pieces largest, others by --pieces 2 and so on");
  Repair repair;
  FitOptions options{.error = 0.01, .pieces = Pieces::Largest, .volume = kInside};
  EXPECT_NEAR(inspect(read(file, options, repair)).volume / (4.0 / 3.0 * std::numbers::pi * 8e-6), 1.0, 0.02);
  EXPECT_EQ(repair.pieces, 2U);
  EXPECT_TRUE(repair.cut);
  options.piece = 2;
  EXPECT_LT(inspect(read(file, options, repair)).volume, 8e-8);
  options.piece = 3;
  EXPECT_THROW((void)read(file, options, repair), Error);
  options.piece = 1;
  repair = {};
  options.volume = {.iso = -150.0};
  EXPECT_TRUE(inspect(read(written("cut.mha", kMeta + "ElementDataFile = LOCAL\n" + bytes_of(ball())), options, repair)).closed);
  EXPECT_TRUE(repair.cut);
}

TEST(FitVolume, OptionsOfVolumesAreRefusedForMeshes) {
  EXPECT_EQ(message(test::saved(test::block(Vec3::Ones()), "block")), "block.obj: expected a volume, of which --iso, --window and --label choose a part, found another kind of data; leave these options out");
  EXPECT_THROW((void)fit(written("w.mha", kMeta), {.volume = {.window = std::array{2.0, 1.0}}}), Error);
}

}  // namespace
}  // namespace supple::fit
