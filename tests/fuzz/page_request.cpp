// What browsers say to nodal-web: cookies, bearer tokens, ranges of bytes, and JSON.
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "host_tool/web/header_values.h"
#include "host_tool/web/operations.h"
#include "protocol/base/result.h"

namespace web = nodal::host::web;

namespace {

void try_range(std::string_view text, std::uint64_t size) {
  const web::ParsedRange parsed = web::parse_range(text, size);
  if (parsed.kind != web::RangeKind::kPart) return;
  NODAL_ASSERT(parsed.range.length > 0 && parsed.range.begin < size);
  NODAL_ASSERT(parsed.range.length <= size - parsed.range.begin);
}

void try_operation(std::string_view name, std::string_view json) {
  const auto request = web::operation(name, json);
  if (!request) return;
  NODAL_ASSERT(json.size() <= web::kMaxOperationBytes);
  NODAL_ASSERT(request->what_case() != nodal::wire::Request::WHAT_NOT_SET);
  NODAL_ASSERT(request->id() == 0 && request->on_behalf().empty());
  NODAL_ASSERT(request->ByteSizeLong() <= 2 * web::kMaxOperationBytes);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (const auto secret = web::secret_of_cookie(text, "__Host-nodal")) {
    NODAL_ASSERT(web::is_hex(*secret, web::kSecretDigits));
    NODAL_ASSERT(text.find("__Host-nodal=" + *secret) != std::string_view::npos);
  }
  if (const auto secret = web::secret_of_bearer(text)) NODAL_ASSERT(text.find(*secret) != std::string_view::npos);
  for (const std::uint64_t bytes : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{1000}, UINT64_MAX})
    try_range(text, bytes);
  for (const std::string_view name : {"record", "still", "mark", "protect", "genlock", "exposure", "heads"})
    try_operation(name, text);
  return 0;
}
