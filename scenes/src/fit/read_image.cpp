#ifdef SUPPLE_HAS_NIFTI
#include <nifti1_io.h>
#endif
#ifdef SUPPLE_HAS_TEEM
#include <teem/biff.h>
#include <teem/nrrd.h>
#endif

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <string_view>

#include "fit/data.h"
#include "fit/meta_image.h"
#include "fit/volume.h"

namespace supple::fit {
namespace {

constexpr double kMillimetre = 1e-3;

#ifdef SUPPLE_HAS_NIFTI
[[noreturn]] void refuse_bytes(const std::filesystem::path& file, const char* what, ErrorKind kind = ErrorKind::Scene) {
  refuse(file, std::string("expected ") + what, "text or bytes that are none, or that end early", "the extension says how a file is read", kind);
}

struct FreeNifti {
  void operator()(nifti_image* image) const { nifti_image_free(image); }
};
using NiftiImage = std::unique_ptr<nifti_image, FreeNifti>;

template <class T>
void copy_values(const void* data, std::size_t count, std::vector<float>& out) {
  const T* values = static_cast<const T*>(data);
  out.assign(values, values + count);
}

bool copy_nifti(const nifti_image& image, std::vector<float>& out) {
  const std::size_t n = image.nvox;
  switch (image.datatype) {
    case DT_UINT8: copy_values<std::uint8_t>(image.data, n, out); return true;
    case DT_INT8: copy_values<std::int8_t>(image.data, n, out); return true;
    case DT_UINT16: copy_values<std::uint16_t>(image.data, n, out); return true;
    case DT_INT16: copy_values<std::int16_t>(image.data, n, out); return true;
    case DT_UINT32: copy_values<std::uint32_t>(image.data, n, out); return true;
    case DT_INT32: copy_values<std::int32_t>(image.data, n, out); return true;
    case DT_FLOAT32: copy_values<float>(image.data, n, out); return true;
    case DT_FLOAT64: copy_values<double>(image.data, n, out); return true;
    default: return false;
  }
}

void place_nifti(const nifti_image& image, Volume& volume) {
  const double unit = image.xyz_units == NIFTI_UNITS_METER ? 1.0 : image.xyz_units == NIFTI_UNITS_MICRON ? 1e-6 : kMillimetre;
  volume.axes = Vec3(image.dx, image.dy, image.dz).asDiagonal();
  if (image.sform_code > 0 || image.qform_code > 0) {
    const mat44& m = image.sform_code > 0 ? image.sto_xyz : image.qto_xyz;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) volume.axes(row, column) = m.m[row][column];
      volume.origin[row] = m.m[row][3];
    }
  }
  volume.axes *= unit;
  volume.origin *= unit;
}

/// Whether the file holds all voxels: libnifti leaves those at 0 that a file lacks. The last bytes of a compressed file are its size.
bool is_complete(const std::filesystem::path& file, const nifti_image& header) {
  const std::uint64_t bytes = static_cast<std::uint64_t>(header.iname_offset) + std::uint64_t{header.nvox} * static_cast<std::uint64_t>(header.nbyper);
  if (extension_of(file) != ".nii.gz") return std::filesystem::file_size(file) >= bytes;
  std::uint32_t size = 0;
  std::ifstream in(file, std::ios::binary);
  in.seekg(-static_cast<std::streamoff>(sizeof(size)), std::ios::end);
  in.read(reinterpret_cast<char*>(&size), sizeof(size));
  constexpr std::uint64_t kPadding = 4096;
  return in && size >= bytes && size <= bytes + kPadding;
}

Volume read_nifti(const std::filesystem::path& file) {
  nifti_set_debug_level(0);
  if (is_nifti_file(file.c_str()) < 1) refuse_bytes(file, "a header of NIfTI-1");
  const NiftiImage header(nifti_image_read(file.c_str(), 0));
  if (!header) refuse_bytes(file, "a header of NIfTI-1");
  Volume out;
  expect_voxels(file, {static_cast<double>(header->nx), static_cast<double>(header->ny), static_cast<double>(header->nz)});
  out.count = {static_cast<std::size_t>(header->nx), static_cast<std::size_t>(header->ny), static_cast<std::size_t>(header->nz)};
  if (header->nvox != out.size()) refuse(file, "expected one volume of single values", std::to_string(header->nvox / out.size()) + " of them", "extract one");
  place_nifti(*header, out);
  expect_axes(file, out);
  const NiftiImage image(is_complete(file, *header) ? nifti_image_read(file.c_str(), 1) : nullptr);
  if (!image) refuse_bytes(file, "the voxels that the header tells of", ErrorKind::Io);
  if (!copy_nifti(*image, out.value)) refuse(file, "expected voxels that are numbers", nifti_datatype_string(image->datatype), "convert them to float");
  if (image->scl_slope != 0.0F) {
    for (float& v : out.value) v = image->scl_slope * v + image->scl_inter;
  }
  return out;
}
#endif

#ifdef SUPPLE_HAS_TEEM
struct FreeNrrd {
  void operator()(Nrrd* nrrd) const { nrrdNuke(nrrd); }
  void operator()(NrrdIoState* state) const { nrrdIoStateNix(state); }
};

/// The first cause of what teem refuses: the last line of its messages, without the name of its function.
std::string reason_of_teem() {
  const std::unique_ptr<char, decltype(&std::free)> messages(biffGetDone(NRRD), std::free);
  std::string out = messages ? messages.get() : "";
  while (!out.empty() && out.back() == '\n') out.pop_back();
  out.erase(0, out.rfind('\n') + 1);
  constexpr std::string_view kAfterName = ": ";
  const std::size_t name = out.find(kAfterName);
  return name == std::string::npos ? out : out.substr(name + kAfterName.size());
}

/// @param header  reads the header only
std::unique_ptr<Nrrd, FreeNrrd> load_nrrd(const std::filesystem::path& file, bool header) {
  std::unique_ptr<Nrrd, FreeNrrd> out(nrrdNew());
  const std::unique_ptr<NrrdIoState, FreeNrrd> state(nrrdIoStateNew());
  state->skipData = header ? AIR_TRUE : AIR_FALSE;
  if (nrrdLoad(out.get(), file.c_str(), state.get()) == 0) return out;
  const std::string reason = "teem says: " + reason_of_teem();
  if (header) refuse(file, "expected a header of NRRD and the data file that it names", "none that can be read", reason);
  refuse(file, "expected the voxels that the header tells of", "fewer, or others", reason, ErrorKind::Io);
}

double length_unit(const char* text) {
  const std::string name = text == nullptr ? "" : text;
  return name == "m" || name == "meter" ? 1.0 : name == "um" || name == "micron" ? 1e-6 : kMillimetre;
}

void place_nrrd(const Nrrd& nrrd, Volume& volume) {
  if (nrrd.spaceDim == 3) {
    for (int k = 0; k < 3; ++k) {
      const double unit = length_unit(nrrd.spaceUnits[k]);
      for (int axis = 0; axis < 3; ++axis) volume.axes(k, axis) = unit * nrrd.axis[axis].spaceDirection[k];
      volume.origin[k] = std::isfinite(nrrd.spaceOrigin[k]) ? unit * nrrd.spaceOrigin[k] : 0.0;
    }
    return;
  }
  for (int axis = 0; axis < 3; ++axis) {
    const double unit = length_unit(nrrd.axis[axis].units);
    volume.axes(axis, axis) = unit * (std::isfinite(nrrd.axis[axis].spacing) ? nrrd.axis[axis].spacing : 1.0);
    if (std::isfinite(nrrd.axis[axis].min)) volume.origin[axis] = unit * nrrd.axis[axis].min;
  }
}

Volume read_nrrd(const std::filesystem::path& file) {
  const auto header = load_nrrd(file, true);
  if (header->dim != 3 || header->type == nrrdTypeBlock) refuse(file, "expected a volume of three axes and single values", std::to_string(header->dim) + " axes", "extract one");
  Volume out;
  expect_voxels(file, {static_cast<double>(header->axis[0].size), static_cast<double>(header->axis[1].size), static_cast<double>(header->axis[2].size)});
  out.count = {header->axis[0].size, header->axis[1].size, header->axis[2].size};
  place_nrrd(*header, out);
  expect_axes(file, out);
  const auto image = load_nrrd(file, false);
  out.value.resize(out.size());
  for (std::size_t n = 0; n < out.value.size(); ++n) out.value[n] = nrrdFLookup[image->type](image->data, n);
  return out;
}
#endif

[[noreturn]] [[maybe_unused]] void refuse_without(const std::filesystem::path& file, const char* library, const char* package) {
  refuse(file, "needs " + std::string(library) + ", without which this program was built", {}, "install " + std::string(package) + " and build it again", ErrorKind::Usage);
}

}  // namespace

Volume read_image(const std::filesystem::path& file) {
  const std::string extension = extension_of(file);
  if (extension == ".mha" || extension == ".mhd") return read_meta_image(file);
  if (extension == ".nrrd" || extension == ".nhdr") {
#ifdef SUPPLE_HAS_TEEM
    return read_nrrd(file);
#else
    refuse_without(file, "teem", "libteem-dev");
#endif
  }
#ifdef SUPPLE_HAS_NIFTI
  return read_nifti(file);
#else
  refuse_without(file, "libnifti", "libnifti-dev");
#endif
}

}  // namespace supple::fit
