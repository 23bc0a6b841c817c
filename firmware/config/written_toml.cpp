#include "firmware/config/written_toml.h"

#include "firmware/config/config.h"
#include "protocol/base/try.h"

namespace nodal::firmware {

Status check_written_toml(std::string_view text, std::string_view file, const std::vector<WrittenHead>& heads) {
  NODAL_TRY_ASSIGN(const auto config, parse_rig_config(text, file));
  std::vector<WrittenHead> read;
  for (const HeadConfig& head : config.heads) read.push_back({head.name, head.port.text()});
  if (read == heads) return {};
  return fail(Errc::kBadValue, std::string(file) + ": its heads are not read as they were written");
}

}  // namespace nodal::firmware
