// JSON documents of films: ffprobe's answers, plans, records of segments. Keys keep their order.
#pragma once

#include <nlohmann/json.hpp>

namespace nodal::film {

using Json = nlohmann::ordered_json;

}  // namespace nodal::film
