#include "firmware/hosts/access.h"

#include <fmt/format.h>

#include <algorithm>

namespace nodal::firmware {
namespace {

bool is_more_than_query(const RequestKind& kind, const wire::Request& request) {
  return kind.by_values && kind.by_values(request);
}

}  // namespace

const RequestKind& kind_of(const wire::Request& request) {
  const auto found = std::ranges::find(request_kinds(), request.what_case(), &RequestKind::what);
  return found == request_kinds().end() ? request_kinds().back() : *found;
}

const CommandKind* command_kind(const wire::Request& request) {
  const RequestKind& kind = kind_of(request);
  return kind.answer && !is_more_than_query(kind, request) ? nullptr : kind.command;
}

bool changes_rig(const wire::Request& request) {
  const CommandKind* const command = command_kind(request);
  return command && command->changes;
}

bool is_important(const wire::Request& request) {
  const CommandKind* const command = command_kind(request);
  return command ? command->important : kind_of(request).important;
}

std::string_view socket_name(Access access) {
  switch (access) {
    case Access::kView: return "view-only";
    case Access::kOperate: return "operate";
    case Access::kControl: break;
  }
  return "control";
}

Access access_needed(const wire::Request& request) {
  const RequestKind& kind = kind_of(request);
  return is_more_than_query(kind, request) ? kind.more : kind.access;
}

Status check_access(Access has, const wire::Request& request) {
  const Access needed = access_needed(request);
  if (has >= needed) return {};
  return fail(Errc::kUnsupported, fmt::format("{}{} is not permitted on this rig's {} link; connect to its {} socket",
                                              kind_of(request).name, request.has_pull() ? " (lossless)" : "",
                                              socket_name(has), socket_name(needed)));
}

}  // namespace nodal::firmware
