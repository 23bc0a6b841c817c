#include "stitch/interchange/opencv_xml.h"

#include <fmt/format.h>

#include <algorithm>
#include <pugixml.hpp>
#include <string>

#include "protocol/base/try.h"
#include "stitch/interchange/foreign_head.h"

namespace nodal::interchange {
namespace {

constexpr int kMaxDepth = 16;      // nested elements; OpenCV's calibrations have 4
constexpr int kMaxMembers = 1000;  // members of a mapping; yaml-cpp searches them one by one

constexpr std::string_view kSpace = " \t\r\n";

YAML::Node words_of(std::string_view text) {
  YAML::Node list(YAML::NodeType::Sequence);
  while (true) {
    text.remove_prefix(std::min(text.find_first_not_of(kSpace), text.size()));
    if (text.empty()) return list;
    const std::string_view word = text.substr(0, text.find_first_of(kSpace));
    list.push_back(std::string(word));
    text.remove_prefix(word.size());
  }
}

Result<YAML::Node> node_of(const pugi::xml_node& element, int depth) {
  if (depth > kMaxDepth) return fail(Errc::kBadFormat, "its XML has elements in elements without end");
  const auto is_element = [](const pugi::xml_node& child) { return child.type() == pugi::node_element; };
  if (!element.find_child(is_element)) {
    const std::string_view text = element.text().get();
    if (std::string_view(element.name()) == "data") return words_of(text);
    const std::size_t first = std::min(text.find_first_not_of(kSpace), text.size());
    return YAML::Node(std::string(text.substr(first, text.find_last_not_of(kSpace) + 1 - first)));
  }
  YAML::Node node;
  int members = 0;
  for (const pugi::xml_node& child : element.children()) {
    if (!is_element(child)) continue;
    NODAL_TRY_ASSIGN(const YAML::Node inner, node_of(child, depth + 1));
    const std::string name = child.name();
    if (name == "_") {
      node.push_back(inner);
    } else {
      if (++members > kMaxMembers) return fail(Errc::kTooLarge, "its XML has an element with too many elements in it");
      node[name] = inner;
    }
  }
  return node;
}

}  // namespace

bool is_xml(std::string_view text) {
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  text.remove_prefix(std::min(text.find_first_not_of(kSpace), text.size()));
  return text.starts_with("<?xml") || text.starts_with("<opencv_storage");
}

Result<YAML::Node> parse_storage_xml(std::string_view text) {
  NODAL_TRY(check_project_size(text));
  pugi::xml_document document;
  const pugi::xml_parse_result parsed =
      document.load_buffer(text.data(), text.size(), pugi::parse_default, pugi::encoding_utf8);
  if (!parsed) {
    return fail(Errc::kBadFormat, fmt::format("it is not XML: {} at byte {}", parsed.description(), parsed.offset));
  }
  const pugi::xml_node storage = document.child("opencv_storage");
  if (!storage) {
    return fail(Errc::kBadFormat, "it is XML without <opencv_storage>: of XML, only OpenCV's FileStorage is read");
  }
  try {
    return node_of(storage, 0);
  } catch (const std::exception& problem) {
    return fail(Errc::kBadFormat, std::string("its XML mixes lists and mappings: ") + problem.what());
  }
}

}  // namespace nodal::interchange
