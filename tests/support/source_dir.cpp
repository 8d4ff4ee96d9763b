#include "support/source_dir.h"

namespace supple::testing {

std::filesystem::path source_dir() { return SUPPLE_SOURCE_DIR; }

}  // namespace supple::testing
