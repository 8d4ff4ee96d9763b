#include "file/fields/fields.h"
#include "file/fields/fields_archive.h"

namespace supple::scenes {

void scene_members(FieldArchive& archive, Scene& scene) { fields(archive, scene); }

}  // namespace supple::scenes
