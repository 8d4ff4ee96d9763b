#include "support/source_dir.h"

namespace supple {

std::filesystem::path source_dir() { return SUPPLE_SOURCE_DIR; }

}  // namespace supple
