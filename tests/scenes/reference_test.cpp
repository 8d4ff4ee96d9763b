#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "supple/scenes/read_scene.h"

namespace supple::scenes {
namespace {

TEST(SceneReference, PageInTheDocsIsTheOneTheReaderWrites) {
  std::ifstream file(std::string(SUPPLE_SOURCE_DIR) + "/docs/scene_reference.md");
  std::stringstream page;
  page << file.rdbuf();
  EXPECT_EQ(page.str(), scene_reference()) << "renew it: supple reference > docs/scene_reference.md";
}

TEST(SceneReference, SchemaIsJsonAndKnowsTheTopLevelKeys) {
  const auto schema = nlohmann::json::parse(scene_json_schema());
  for (const char* key : {"schema", "duration", "objects", "camera", "output"}) {
    EXPECT_TRUE(schema.at("properties").contains(key)) << key;
  }
}

}  // namespace
}  // namespace supple::scenes
