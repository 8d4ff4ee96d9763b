#include "file/fields/fields_rules.h"

#include <cmath>

#include "file/read_scene_faults.h"

namespace supple::scenes {

std::string rule_text(const Rule& rule, bool whole) {
  if (rule.low == rule.high) return number_text(rule.low);
  std::string text = with_article(whole ? "whole number" : rule.quantity.noun);
  const bool low = std::isfinite(rule.low);
  const bool high = std::isfinite(rule.high);
  if (low && high) {
    text += std::string(" in ") + (rule.low_open ? '(' : '[') + number_text(rule.low) + ", " + number_text(rule.high) +
            (rule.high_open ? ')' : ']');
  } else if (low) {
    text += (rule.low_open ? " > " : " >= ") + number_text(rule.low);
  } else if (high) {
    text += (rule.high_open ? " < " : " <= ") + number_text(rule.high);
  }
  if (!rule.quantity.unit.empty()) text += " [" + std::string(rule.quantity.unit) + ']';
  return text;
}

}  // namespace supple::scenes
