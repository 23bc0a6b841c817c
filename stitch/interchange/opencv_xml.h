// OpenCV's FileStorage as XML, as the same tree as its YAML.
#pragma once

#include <yaml-cpp/yaml.h>

#include <string_view>

#include "protocol/base/result.h"

namespace nodal::interchange {

/// Whether the text begins as XML.
bool is_xml(std::string_view text);

/// <opencv_storage>: an element with elements in it is a mapping, or a list if they are called _; one with text is a
/// text, and one that is called data a list of numbers.
/// Errors: kTooLarge, kBadFormat with what is wrong and where.
Result<YAML::Node> parse_storage_xml(std::string_view text);

}  // namespace nodal::interchange
