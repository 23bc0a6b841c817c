// Numbers in requests of the page, and JSON as an answer.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tool/look/server.h"

namespace nodal::host::look {

/// The sides that pictures are asked for with, px.
inline constexpr int kSmallestSide = 16, kLargestSide = 32768;

/// The whole number of a key of the query; nothing if it is missing, no number, or beyond the bounds.
std::optional<int> whole_number(const Wanted& wanted, const std::string& key, int least, int most);
/// A finite number.
std::optional<double> number(const Wanted& wanted, const std::string& key);

/// The ms from each of several times to the next, of times in ns.
Answer steps_document(const std::vector<std::int64_t>& times);

/// Text that is no UTF-8 is replaced.
Answer document(const nlohmann::ordered_json& json);

}  // namespace nodal::host::look
