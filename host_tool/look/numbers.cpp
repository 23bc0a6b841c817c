#include "host_tool/look/numbers.h"

#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

namespace nodal::host::look {
namespace {

template <class Number>
std::optional<Number> parsed(const Wanted& wanted, const std::string& key) {
  const auto found = wanted.query.find(key);
  if (found == wanted.query.end()) return std::nullopt;
  const std::string& text = found->second;
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

std::optional<int> whole_number(const Wanted& wanted, const std::string& key, int least, int most) {
  const std::optional<int> value = parsed<int>(wanted, key);
  return value && *value >= least && *value <= most ? value : std::nullopt;
}

std::optional<double> number(const Wanted& wanted, const std::string& key) {
  const std::optional<double> value = parsed<double>(wanted, key);
  return value && std::isfinite(*value) ? value : std::nullopt;
}

Answer document(const nlohmann::ordered_json& json) {
  Answer answer = Answer::text(200, json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  answer.type = "application/json";
  return answer;
}

Answer steps_document(const std::vector<std::int64_t>& times) {
  nlohmann::ordered_json steps = nlohmann::ordered_json::array();
  const auto ms = [&](std::size_t k) { return (times[k] + 500'000) / 1'000'000; };
  for (std::size_t k = 1; k < times.size(); ++k) steps.push_back(ms(k) - ms(k - 1));
  return document(steps);
}

}  // namespace nodal::host::look
