#include "host_tool/commands/take_argument.h"

#include <charconv>
#include <filesystem>

#include "host_tool/offload/rig_take_files.h"
#include "host_tool/offload/take_files.h"

namespace nodal::host {

Result<media::TakeFolder> open_take(Context& context, const std::string& take) {
  std::uint64_t number = 0;
  const char* const end = take.data() + take.size();
  const auto [stop, error] = std::from_chars(take.data(), end, number);
  std::error_code ignored;
  if (error != std::errc() || stop != end || std::filesystem::exists(take, ignored))
    return media::TakeFolder::open(take_files(take));
  Result<std::unique_ptr<RigConnection>> rig = context.connect();
  if (!rig) return fail(rig.error().in("there is no folder '" + take + "', and the rig"));
  return media::TakeFolder::open(rig_take_files(std::move(*rig), number));
}

}  // namespace nodal::host
