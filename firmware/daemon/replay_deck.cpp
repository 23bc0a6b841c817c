#include "firmware/daemon/replay_deck.h"

#include <string>
#include <utility>

#include "firmware/daemon/log.h"
#include "firmware/replay/take_reel.h"
#include "hal/linux/disk.h"
#include "protocol/base/try.h"
#include "stitch/media/picture_folder.h"
#include "stitch/media/plain_image.h"

namespace nodal::daemon {

std::unique_ptr<hal::replay::Deck> make_deck(const firmware::RigConfig& config, const std::filesystem::path& base,
                                             hal::ClockPort& clock, int buffers) {
  hal::replay::DeckOptions options;
  options.pictures = {media::read_plain_header, media::read_plain_image, [](const std::filesystem::path& folder) {
                        return media::pictures_in(folder, media::read_plain_header, false);
                      }};
  options.note = [](const std::string& sentence) { log_line(LogLevel::kInfo, sentence); };
  options.takes = [](const std::filesystem::path& folder,
                     const std::string& head) -> Result<std::unique_ptr<hal::replay::Reel>> {
    std::error_code error;  // opening a folder for a disk would make it
    if (!std::filesystem::is_directory(folder, error)) {
      return fail(Errc::kNoSuchDevice, folder.string() + ": there is no such folder");
    }
    NODAL_TRY_ASSIGN(auto disk, hal::linux_os::LinuxDisk::open(folder.string()));
    return firmware::open_take_reel(std::move(disk), "", folder.string(), head);
  };
  options.rate = config.rate;
  options.base = base;
  options.buffers = buffers;
  auto deck = std::make_unique<hal::replay::Deck>(clock, options);
  for (const firmware::HeadConfig& head : config.heads) {
    if (!firmware::is_replayed(head.port.kind)) continue;
    deck->want_format(head.port.text(), head.format);
    deck->want_fields(head.port.text(), head.fields);
  }
  return deck;
}

}  // namespace nodal::daemon
