// How much of what the bus carries reaches the cable's user, beside a plain loop of USB transfers. In the guest's
// virtual time computation takes none: this shows transfers that wait for each other, not the processor's work.
#include <gtest/gtest.h>
#include <chrono>
#include <fstream>
#include <future>
#include <thread>

#include "cable_rig.h"
#include "hal/linux/cable/cable.h"
#include "hal/linux/cable/function_fs.h"
#include "hal/linux/cable/host/device.h"
#include "hal/linux/link/wait.h"

namespace nodal::hil {
namespace {

using hal::LinkPort;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kBytes = 8U << 20;

double megabytes_a_second(Clock::time_point since) {
  return static_cast<double>(kBytes) / 1e6 / std::chrono::duration<double>(Clock::now() - since).count();
}

/// One end writes transfers, the other reads them, one after another.
double plain_loop() {
  const CableGadget gadget("PLAIN");
  auto function = hal::cable::open_function(gadget.folder(), "plain");
  EXPECT_TRUE(function) << function.error().text();
  gadget.plug();
  auto device = hal::cable::open_device("PLAIN");
  EXPECT_TRUE(device) << device.error().text();
  while (const auto event = *(*function)->next_event()) (void)event;
  std::thread rig([&] {
    for (std::size_t sent = 0; sent < kBytes; sent += hal::cable::kTransferBytes) {
      EXPECT_TRUE((*function)->queue_write(0, hal::cable::kTransferBytes));
      while (!(*function)->next_completion()) (*function)->wait(Duration::seconds(1));
    }
  });
  std::vector<std::uint8_t> buffer(hal::cable::kTransferBytes);
  const auto begun = Clock::now();
  for (std::size_t got = 0; got < kBytes; got += buffer.size()) {
    int n = 0;
    EXPECT_EQ(libusb_bulk_transfer(device->handle.get(), device->from_rig, buffer.data(),
                                   static_cast<int>(buffer.size()), &n, 5000),
              0);
    EXPECT_EQ(static_cast<std::size_t>(n), buffer.size());
  }
  const double rate = megabytes_a_second(begun);
  rig.join();
  return rate;
}

void wait_for_link(const LinkPort& link, bool to_write) {
  hal::WakeUps wake_ups;
  link.add_wake_ups(wake_ups, !to_write, to_write);
  hal::wait_for(wake_ups, Instant(), Duration::seconds(1));
}

double through(LinkPort& from, LinkPort& to) {
  const auto begun = Clock::now();
  std::thread sender([&] {
    const std::vector<std::uint8_t> bytes(65536);
    for (std::size_t sent = 0; sent < kBytes;) {
      const auto n = from.write(std::span(bytes).first(std::min(bytes.size(), kBytes - sent)));
      ASSERT_TRUE(n) << n.error().text();
      sent += *n;
      if (*n == 0) wait_for_link(from, true);
    }
  });
  std::vector<std::uint8_t> bytes(65536);
  for (std::size_t got = 0; got < kBytes;) {
    const auto n = to.read(bytes);
    if (!n) {
      ADD_FAILURE() << n.error().text();
      break;
    }
    got += *n;
    if (*n == 0) wait_for_link(to, false);
  }
  const double rate = megabytes_a_second(begun);
  sender.join();
  return rate;
}

TEST(CableSpeed, BothDirections_FillTheBusAndAreFasterThanAPlainLoop) {
  const double plain = plain_loop();
  const CableGadget gadget("FAST");
  auto listener = hal::cable::listen_cable(gadget.folder(), "fast");
  ASSERT_TRUE(listener) << listener.error().text();
  gadget.plug();
  auto connecting = std::async(std::launch::async, [] { return hal::cable::connect_cable("FAST"); });
  std::unique_ptr<LinkPort> rig;
  while (!rig) {
    rig = std::move(*(*listener)->accept());
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  const auto host = connecting.get();
  ASSERT_TRUE(host) << host.error().text();
  const double down = through(*rig, **host);
  const double up = through(**host, *rig);
  std::ofstream("speed.txt") << "MB/s: plain loop " << plain << ", cable from the rig " << down << ", to the rig " << up
                             << "\n";
  // A high-speed bus carries 13 packets of 512 bytes in each of 8000 microframes a second.
  constexpr double kBus = 13 * 512 * 8000 / 1e6;
  EXPECT_GT(down, 0.9 * kBus);
  EXPECT_GT(up, 0.9 * kBus);
  EXPECT_GT(down, plain);
}

TEST(CableSpeed, ATake_IsOffloadedNearlyAsFastAsByAPlainLoop) {
  const double plain = plain_loop();
  std::filesystem::create_directories(kScratch);
  const CableGadget gadget("RIG7", 0, "nobody");
  CableNodald rig(gadget);
  const test::Finished started = nodal(rig.by_cable(), {"take", "start"});
  ASSERT_EQ(started.code, 0) << started.err;
  std::this_thread::sleep_for(std::chrono::seconds(8));
  ASSERT_EQ(nodal(rig.by_cable(), {"take", "stop"}).code, 0);
  const std::string to = kScratch + "/copies";
  const auto begun = Clock::now();
  const test::Finished done = nodal(rig.by_cable(), {"offload", "--new", "--to", to});
  const double seconds = std::chrono::duration<double>(Clock::now() - begun).count();
  ASSERT_EQ(done.code, 0) << done.err;
  const auto take = nlohmann::json::parse(done.out.substr(0, done.out.find('\n')))["takes"][0];
  const double megabytes = take["fetched"].get<double>() / 1e6;
  EXPECT_GT(megabytes, 8);
  std::ofstream("offload.txt") << "MB/s: plain loop " << plain << ", offload " << megabytes / seconds << " ("
                               << megabytes << " MB)\n";
  EXPECT_GE(megabytes / seconds, 0.8 * plain);
  EXPECT_EQ(test::Process({NODAL_BIN_DIR "/nodal", "take", "verify", to + "/000001"}).wait().code, 0);
}

}  // namespace
}  // namespace nodal::hil
