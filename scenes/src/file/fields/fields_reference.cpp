#include <nlohmann/json.hpp>

#include "file/fields/fields_info.h"
#include "file/read_scene_faults.h"
#include "supple/scenes/read_scene.h"

namespace supple::scenes {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kShorthand = R"(## Variables, expressions, repetition, includes

```yaml
include: [materials.yaml, camera.yaml]   # files of this folder
variables:
  r: 5 cm
  n: 12
defaults:
  objects: {contact: {modulus: 20 kPa}}  # keys of every item of a list
objects:
  - repeat: {i: "${n}"}                  # n copies with i = 0 .. n - 1; several indices are nested; `repeat: 12` has the index i
    name: ball${i}
    particles: {arrange: single, at: ["${2.1*r*i}", 0, "${r + 2 cm}"], mass: 0.1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: "${r/0.6}"}}]
```

| key | expected | meaning |
|---|---|---|
| `include` | the name of a file, or a list of them | files whose keys are merged into this one; in an item of a list: into that item |
| `variables` | a mapping of names to values | values for expressions |
| `defaults` | a mapping of lists of the scene to mappings | keys of every item of a list |
| `materials` | a mapping of names to mappings | materials that objects may name, `material: jelly`, in place of a mapping |
| `repeat` | a count, or a mapping of indices to counts | in an item of a list: how often it stands there |
| `emit` | a mapping of `rate`, `count` and `from` (default 0) | in an item of `objects`: so many of them appear one after the other; they are named NAME.1, NAME.2 ... and have the index `i` |

- **Expressions** stand between `${` and `}`: numbers, numbers with units, variables, `+ - * / ^`, parentheses, `pi`, and `sqrt`, `abs`,
  `min`, `max`, `floor`, `ceil`, `round`, `exp`, `log`, `sin`, `cos`, `tan`, `asin`, `acos`, `atan`, `atan2`. Dimensions are checked. Units
  bind to the number before them: `1/2 s` is 0.5 Hz. An expression that is all of a value keeps its unit; inside a text it becomes text.
  Within `[ ]` and `{ }` YAML needs quotes around it. `$${` stands for `${`. Nothing is executed.
- **Variables** are numbers, quantities or texts, may use one another, and are set by `--set variables.r=3cm`.
- **Defaults** are merged into each item of a list of the scene (`objects`, `obstacles`, ...) where it does not have the key.
- **Files** that a scene names are, after links are resolved, in its own folder or below it. Others need `--allow-path`.
- **Includes** are such files. Mappings are merged, lists of mappings joined; the scene's own keys win, and so does a later file
  over an earlier one. An object in a file of its own is included by an item of `objects`, as often as wanted:
  `{name: hare, include: bunny.yaml, particles: {at: [0, 0, 1]}, scale: 2, material: rubber}`. Files that an included file names are relative to the scene.
  `include: supple:materials` is part of the program: it has the materials `jelly`, `rubber`, `foam`, `clay` and `steel`.

)";

std::string required_text(const FieldInfo& info) {
  if (!info.required) return info.default_text.empty() ? "-" : '`' + info.default_text + '`';
  return "required";
}

/// One table per mapping, outer before inner.
void write_tables(const std::vector<FieldInfo>& list, const std::string& path, std::string& out) {
  out += path.empty() ? "## The scene\n\n" : "## `" + path + "`\n\n";
  out += "| key | expected | default | meaning |\n|---|---|---|---|\n";
  for (const FieldInfo& info : list) {
    out += "| `" + std::string(info.key) + "` | " + expectation(info.type, info.choices, info.rule);
    if (info.rule.automatic) out += ", or `auto`";
    if (info.may_be_absent && info.type == FieldType::Mapping) out += info.may_be_empty ? ", or `true`, `false`" : ", or `false`";
    out += " | " + required_text(info) + " | " + std::string(info.meaning);
    if (!info.rule.when.choices.empty()) {
      out += " (with `" + std::string(info.rule.when.selector) + "`: " + joined(info.rule.when.choices) + ')';
    }
    out += " |\n";
  }
  out += '\n';
  for (const FieldInfo& info : list) {
    if (info.children.empty()) continue;
    const std::string below = (path.empty() ? "" : path + '.') + std::string(info.key) + (info.type == FieldType::Mappings ? "[]" : "");
    write_tables(info.children, below, out);
  }
}

void write_units(std::string& out) {
  out += "## Units\n\nProducts, quotients and powers of these are units too: `N s/m`, `kg/m^3`, `1/s`.\n\n"
         "| quantity | units | also accepted |\n|---|---|---|\n";
  for (const UnitsOfKind& kind : known_units()) {
    out += "| " + std::string(kind.noun) + " | " + joined(kind.units) + " | " + joined(kind.words) + " |\n";
  }
  out += '\n';
}

Json number_schema(const Rule& rule, bool whole) {
  Json number{{"type", whole ? "integer" : "number"}};
  if (std::isfinite(rule.low)) number[rule.low_open ? "exclusiveMinimum" : "minimum"] = rule.low;
  if (std::isfinite(rule.high)) number[rule.high_open ? "exclusiveMaximum" : "maximum"] = rule.high;
  Json any = Json::array({number});
  if (!whole && !rule.quantity.unit.empty()) {
    any.push_back({{"type", "string"}, {"pattern", R"(^[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)? *[A-Za-z%1/\u00b0\u00b5\u03bc].*$)"}});
  }
  any.push_back({{"type", "string"}, {"pattern", R"(^\$\{.*\}$)"}});  // an expression
  if (rule.automatic) any.push_back({{"const", "auto"}});
  return {{"anyOf", any}};
}

Json mapping_schema(const std::vector<FieldInfo>& list);

Json list_schema(Json items, const Rule& rule, std::size_t least, std::size_t most) {
  Json out{{"type", "array"}, {"items", std::move(items)}};
  if (rule.least_items != 0) least = rule.least_items;
  if (rule.most_items < most) most = rule.most_items;
  if (least != 0) out["minItems"] = least;
  if (most < 1000) out["maxItems"] = most;
  return out;
}

Json value_schema(const FieldInfo& info) {
  constexpr auto kAny = std::numeric_limits<std::size_t>::max();
  switch (info.type) {
    case FieldType::Number: return number_schema(info.rule, false);
    case FieldType::Whole: return number_schema(info.rule, true);
    case FieldType::Boolean:
      if (info.rule.automatic) return {{"anyOf", Json::array({{{"type", "boolean"}}, {{"const", "auto"}}})}};
      return {{"type", "boolean"}};
    case FieldType::Text:
      return info.rule.name ? Json{{"type", "string"}, {"pattern", R"(^([A-Za-z_][A-Za-z0-9_.-]*|.*\$\{.*\}.*)$)"}} : Json{{"type", "string"}};
    case FieldType::Choice: return {{"enum", info.choices}};
    case FieldType::Choices: {
      const Json one{{"enum", info.choices}};
      return {{"anyOf", Json::array({one, list_schema(one, {}, 0, kAny), {{"const", "none"}}})}};
    }
    case FieldType::Vector: return list_schema(number_schema(info.rule, false), info.rule, 3, 3);
    case FieldType::Vectors: {
      const Json point = list_schema(number_schema(info.rule, false), {}, 3, 3);
      return list_schema(point, info.rule, 0, kAny);
    }
    case FieldType::Numbers: return list_schema(number_schema(info.rule, false), info.rule, 0, kAny);
    case FieldType::Wholes: return list_schema(number_schema(info.rule, true), info.rule, 0, kAny);
    case FieldType::Texts: return list_schema({{"type", "string"}}, info.rule, 0, kAny);
    case FieldType::Mapping: {
      Json mapping = mapping_schema(info.children);
      if (!info.may_be_absent) return mapping;
      const Json word = info.may_be_empty ? Json{{"type", "boolean"}} : Json{{"const", false}};
      return {{"anyOf", Json::array({mapping, word})}};
    }
    case FieldType::Mappings: {
      Json item = mapping_schema(info.children);
      item["properties"]["repeat"] = {{"anyOf", Json::array({number_schema({.low = 0.0}, true), {{"type", "object"}}})},
                                      {"description", "copies of the item: a count, with the index i, or a mapping of indices to counts"}};
      if (info.key == "objects") {
        item["properties"]["emit"] = {{"type", "object"}, {"required", Json::array({"rate", "count"})},
                                      {"description", "objects that appear one after the other: rate, count, and from, the time of the first"}};
      }
      item["properties"]["include"] = {{"anyOf", Json::array({Json{{"type", "string"}}, list_schema({{"type", "string"}}, {}, 0, kAny)})},
                                       {"description", "files whose keys are merged into the item"}};
      return list_schema(std::move(item), info.rule, 0, kAny);
    }
  }
  return {};
}

Json mapping_schema(const std::vector<FieldInfo>& list) {
  Json properties = Json::object();
  Json required = Json::array();
  Json conditions = Json::array();
  for (const FieldInfo& info : list) {
    const std::string key(info.key);
    Json schema = value_schema(info);
    schema["description"] = info.meaning;
    if (properties.contains(key)) {  // a key with another unit for other kinds: either will do for an editor
      properties[key] = {{"anyOf", Json::array({properties[key], schema})}};
    } else {
      properties[key] = std::move(schema);
    }
    const When& when = info.rule.when;
    if (info.required && when.choices.empty()) required.push_back(key);
    if (info.required && !when.choices.empty()) {
      const std::string selector(when.selector);
      conditions.push_back({{"if", {{"properties", {{selector, {{"enum", when.choices}}}}}, {"required", {selector}}}},
                            {"then", {{"required", {key}}}}});
    }
  }
  Json out{{"type", "object"}, {"additionalProperties", false}, {"properties", std::move(properties)}};
  if (!required.empty()) out["required"] = std::move(required);
  if (!conditions.empty()) out["allOf"] = std::move(conditions);
  return out;
}

}  // namespace

std::string scene_reference() {
  std::string out =
      "# Scene files\n\n"
      "Scenes are YAML, so JSON works too. Bare numbers are in SI units; `\"5 cm\"`, `\"2 ms\"`, `\"3 kN\"` are converted, and their dimension is\n"
      "checked. Numbers are 0 or between 1e-50 and 1e50 in size, and may be fractions: `30000/1001`, `5/8 in`; those\n"
      "in tables and meshes are at most 1e50 in size, too. Keys that end in\n"
      "`_deg` are in degrees. `true` and `false` may be written `True`, `TRUE`, `False`, `FALSE`.\n"
      "`--set objects.ball.particles.mass=2` overrides any key. `supple reference` generates this page.\n\n";
  write_units(out);
  out += kShorthand;
  write_tables(scene_fields(), "", out);
  return out;
}

std::string scene_json_schema() {
  Json out{{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", "supple scene"}};
  out.update(mapping_schema(scene_fields()));
  Json& properties = out["properties"];
  properties["include"] = {{"anyOf", Json::array({{{"type", "string"}}, {{"type", "array"}, {"items", {{"type", "string"}}}}})},
                           {"description", "files of the scene's folder whose keys are merged into this one"}};
  properties["materials"] = {{"type", "object"}, {"description", "materials that objects name"}};
  properties["objects"]["items"]["properties"]["material"]["anyOf"].push_back({{"type", "string"}});
  properties["variables"] = {{"type", "object"}, {"description", "names and values for expressions"}};
  properties["defaults"] = {{"type", "object"}, {"description", "keys of every item of the named lists"}};
  return out.dump(2) + '\n';
}

}  // namespace supple::scenes
