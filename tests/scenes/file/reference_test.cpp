#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "supple/scenes/read_scene.h"
#include "support/source_dir.h"

namespace supple::scenes {
namespace {

TEST(SceneReference, PageInTheDocsIsTheOneTheReaderWrites) {
  std::ifstream file(source_dir() / "docs/scene_reference.md");
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

TEST(SceneReference, OffersTrueOnlyWhereAMappingNeedsNoKey) {
  const std::string page = scene_reference();
  for (const char* row : {"| `restitution` | a mapping, or `false` |", "| `stick` | a mapping, or `false` |", "| `breaking` | a mapping, or `false` |",
                          "| `sleep` | a mapping, or `true`, `false` |", "| `ground` | a mapping, or `true`, `false` |"}) {
    EXPECT_NE(page.find(row), std::string::npos) << row;
  }
  const auto schema = nlohmann::json::parse(scene_json_schema());
  const auto& objects = schema.at("properties").at("objects").at("items").at("properties");
  EXPECT_EQ(objects.at("yielding").at("anyOf").at(1), nlohmann::json({{"const", false}}));
  EXPECT_EQ(objects.at("medium").at("anyOf").at(1), nlohmann::json({{"type", "boolean"}}));
}

}  // namespace
}  // namespace supple::scenes
