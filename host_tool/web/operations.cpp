#include "host_tool/web/operations.h"

#include <fmt/format.h>

#include <array>
#include <limits>
#include <nlohmann/json.hpp>

#include "protocol/base/try.h"
#include "protocol/base/units.h"
#include "protocol/strict_json.h"

namespace nodal::host::web {
namespace {

constexpr std::size_t kMaxText = 200;  // bytes of a mark, as for the rig
constexpr std::size_t kMaxNamedHeads = 64;

/// Reads fields of a document; the first field that is wrong is the error.
class Fields {
 public:
  explicit Fields(const nlohmann::json& document) : document_(document) {}

  bool has(const char* key) const { return document_.contains(key); }
  bool flag(const char* key) {
    const nlohmann::json* const value = find(key);
    if (value != nullptr && !value->is_boolean()) refuse(key, "is true or false");
    return value != nullptr && value->is_boolean() && value->get<bool>();
  }
  template <class Number>
  Number number(const char* key) {
    const nlohmann::json* const value = find(key);
    if (value == nullptr) return 0;
    return number_of<Number>(key, *value);
  }
  std::string text(const char* key) {
    const nlohmann::json* const value = find(key);
    if (value != nullptr && !value->is_string()) refuse(key, "is a text");
    return value != nullptr && value->is_string() ? value->get<std::string>() : "";
  }
  template <class Number, class Add>
  void numbers(const char* key, const Add& add) {
    const nlohmann::json* const value = find(key);
    if (value == nullptr) return;
    if (!value->is_array() || value->size() > kMaxNamedHeads) return refuse(key, "is a list of numbers");
    for (const nlohmann::json& each : *value) add(number_of<Number>(key, each));
  }
  Status status() const { return error_ ? Status(fail(*error_)) : Status(); }

 private:
  const nlohmann::json* find(const char* key) {
    const auto found = document_.find(key);
    if (found == document_.end()) {
      refuse(key, "is missing");
      return nullptr;
    }
    return &*found;
  }
  template <class Number>
  Number number_of(const char* key, const nlohmann::json& value) {
    if (value.is_number_unsigned() && value.get<std::uint64_t>() <= std::uint64_t{std::numeric_limits<Number>::max()})
      return static_cast<Number>(value.get<std::uint64_t>());
    if constexpr (std::numeric_limits<Number>::is_signed) {
      if (value.is_number_integer() && !value.is_number_unsigned() &&
          value.get<std::int64_t>() >= std::int64_t{std::numeric_limits<Number>::min()})
        return static_cast<Number>(value.get<std::int64_t>());
    }
    refuse(key, "is a whole number within its range");
    return 0;
  }
  void refuse(const char* key, const char* what) {
    if (!error_) error_ = Error{Errc::kBadValue, fmt::format("\"{}\" {}", key, what)};
  }

  const nlohmann::json& document_;
  std::optional<Error> error_;
};

void record(Fields& fields, wire::Request& request) {
  if (fields.flag("on")) request.mutable_take_start();
  else request.mutable_take_stop();
}

void still(Fields&, wire::Request& request) { request.mutable_take_start()->set_still(true); }

void mark(Fields& fields, wire::Request& request) { request.mutable_take_mark()->set_text(fields.text("text")); }

void protect(Fields& fields, wire::Request& request) {
  request.mutable_take_protect()->set_take(fields.number<std::uint64_t>("take"));
  request.mutable_take_protect()->set_on(fields.flag("on"));
}

void genlock(Fields& fields, wire::Request& request) {
  request.mutable_genlock()->set_action(fields.flag("on") ? wire::GenlockRequest::START : wire::GenlockRequest::STOP);
}

void exposure(Fields& fields, wire::Request& request) {
  wire::ExposureRequest& set = *request.mutable_exposure();
  if (fields.has("program")) set.set_program(fields.text("program"));
  if (fields.has("locked")) set.set_locked(fields.flag("locked"));
  if (fields.has("anchor")) set.set_anchor(fields.number<std::int32_t>("anchor"));
  if (fields.has("longest_ns")) set.set_longest_ns(fields.number<std::uint64_t>("longest_ns"));
  if (fields.has("highest_gain_mdb")) set.set_highest_gain_mdb(fields.number<std::int32_t>("highest_gain_mdb"));
}

void heads(Fields& fields, wire::Request& request) {
  wire::HeadSetRequest& set = *request.mutable_head_set();
  if (fields.has("heads")) fields.numbers<std::uint32_t>("heads", [&](std::uint32_t head) { set.add_heads(head); });
  if (fields.has("exposure_ns")) set.set_exposure_ns(fields.number<std::uint64_t>("exposure_ns"));
  if (fields.has("gain_mdb")) set.set_gain_mdb(fields.number<std::int32_t>("gain_mdb"));
}

struct Operation {
  std::string_view name;
  std::string_view keys;  ///< which it knows, each between blanks
  void (*fill)(Fields& fields, wire::Request& request);
};
constexpr std::array kOperations{
    Operation{"record", " on ", &record},
    Operation{"still", " ", &still},
    Operation{"mark", " text ", &mark},
    Operation{"protect", " take on ", &protect},
    Operation{"genlock", " on ", &genlock},
    Operation{"exposure", " program locked anchor longest_ns highest_gain_mdb ", &exposure},
    Operation{"heads", " heads exposure_ns gain_mdb ", &heads},
};

const JsonShape& shape() {
  static const JsonShape kShape = [] {
    const JsonShape value = JsonShape::value(kMaxText + 1);
    return JsonShape::object({{"on", value},
                              {"text", value},
                              {"take", value},
                              {"program", value},
                              {"locked", value},
                              {"anchor", value},
                              {"longest_ns", value},
                              {"highest_gain_mdb", value},
                              {"heads", JsonShape::list(kMaxNamedHeads, JsonShape::value())},
                              {"exposure_ns", value},
                              {"gain_mdb", value}});
  }();
  return kShape;
}

}  // namespace

Result<wire::Request> operation(std::string_view name, std::string_view json) {
  const auto* const found = std::ranges::find(kOperations, name, &Operation::name);
  if (found == kOperations.end()) return fail(Errc::kNotFound, "there is no such operation");
  NODAL_TRY_ASSIGN(const nlohmann::json document, parse_strict_json(json, {kMaxOperationBytes, 3}, shape()));
  if (!document.is_object()) return fail(Errc::kBadFormat, "a JSON object is needed");
  for (const auto& [key, value] : document.items()) {
    if (found->keys.find(" " + key + " ") == std::string_view::npos)
      return fail(Errc::kBadValue, fmt::format("{} does not know one of the fields", name));
  }
  wire::Request request;
  Fields fields(document);
  found->fill(fields, request);
  NODAL_TRY(fields.status());
  // Without a value these two would be questions, which only reading asks.
  if ((request.has_exposure() || request.has_head_set()) && document.size() <= (document.contains("heads") ? 1U : 0U))
    return fail(Errc::kBadValue, fmt::format("{} needs a value to set", name));
  return request;
}

}  // namespace nodal::host::web
