#include "hal/linux/gpio/system.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>

namespace nodal::hal::gpio {
namespace {

std::string joined(const std::vector<std::string>& chips) {
  if (chips.empty()) return "this machine has no GPIO chip, or nodald may not open it";
  std::string all = "this machine has ";
  for (std::size_t i = 0; i < chips.size(); ++i) all += (i > 0 ? ", " : "") + chips[i];
  return all;
}

}  // namespace

std::string LineName::text() const { return fmt::format("gpio:{}:{}", chip, offset); }

Error explain_claim(System& system, const LineName& line, int error) {
  const auto because = [&](Errc code, const std::string& sentence) {
    return Error{code, "line " + line.text() + ": " + sentence};
  };
  switch (error) {
    case ENOENT:
    case ENODEV:
    case ENOTTY:
    case ENXIO:
      return because(Errc::kNoSuchDevice, "there is no GPIO chip with the name or label '" + line.chip + "'; " +
                                              joined(system.chips()) + "; correct rig.toml");
    case EINVAL:
      return because(Errc::kNoSuchDevice,
                     fmt::format("the chip has no line {} that can be used in this way; {}; correct rig.toml",
                                 line.offset, joined(system.chips())));
    case EBUSY: {
      const std::string holder = system.holder(line);
      if (holder == "nodald") {
        return because(Errc::kBusy,
                       "busy: held by 'nodald'; end the other nodald, or correct rig.toml if it names this line twice "
                       "(by name and by label of its chip)");
      }
      return because(Errc::kBusy, "busy: held by " + (holder.empty() ? "an unnamed program" : "'" + holder + "'") +
                                      "; stop that program or the driver that uses the line (gpioinfo lists holders)");
    }
    case EACCES:
    case EPERM:
      return because(Errc::kDeviceFailed,
                     "permission denied; add nodald's user to the group gpio, with a udev rule that gives this group "
                     "the chip: SUBSYSTEM==\"gpio\", GROUP=\"gpio\", MODE=\"0660\"");
    case EOPNOTSUPP:
      return because(Errc::kUnsupported, "the chip cannot do this (edges or a pull); choose a line of another chip");
    default: return because(Errc::kDeviceFailed, std::string("cannot be claimed: ") + std::strerror(error));
  }
}

Error explain_use(const LineName& line, const std::string& doing, int error) {
  const std::string who = "line " + line.text() + ": ";
  if (error == ENODEV || error == ENXIO) {
    return {Errc::kDeviceGone, who + "its chip is not there any more; restart nodald when it is back"};
  }
  return {Errc::kDeviceFailed, who + doing + ": " + std::strerror(error) + "; the kernel's log (dmesg) may say more"};
}

}  // namespace nodal::hal::gpio
