#include "gpio_sim.h"

#include <fcntl.h>
#include <linux/gpio.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <thread>

namespace nodal::hil {
namespace {

const std::string kConfig = "/sys/kernel/config";

void write_text(const std::string& file, const std::string& text) {
  const int fd = ::open(file.c_str(), O_WRONLY | O_CLOEXEC);
  const bool done = fd >= 0 && ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const int error = errno;
  if (fd >= 0) ::close(fd);
  if (!done) throw std::runtime_error(file + ": " + std::strerror(error));
}

std::string read_text(const std::string& file) {
  std::ifstream in(file);
  std::string text;
  if (!(in >> text)) throw std::runtime_error(file + " cannot be read");
  return text;
}

std::string mounted_folder(const std::string& label) {
  if (!std::filesystem::exists(kConfig + "/gpio-sim") &&
      ::mount("none", kConfig.c_str(), "configfs", 0, nullptr) != 0) {
    throw std::runtime_error("configfs: " + std::string(std::strerror(errno)));
  }
  return kConfig + "/gpio-sim/" + label;
}

}  // namespace

SimChip::SimChip(const std::string& label, int lines) : folder_(mounted_folder(label)) {
  std::filesystem::create_directory(folder_);
  std::filesystem::create_directory(folder_ + "/bank0");
  write_text(folder_ + "/bank0/num_lines", std::to_string(lines));
  write_text(folder_ + "/bank0/label", label);
  write_text(folder_ + "/live", "1");
  name_ = read_text(folder_ + "/bank0/chip_name");
  lines_ = "/sys/devices/platform/" + read_text(folder_ + "/dev_name") + "/" + name_ + "/sim_gpio";
}

SimChip::~SimChip() {
  remove();
  std::error_code ignored;
  std::filesystem::remove(folder_ + "/bank0", ignored);
  std::filesystem::remove(folder_, ignored);
}

void SimChip::remove() {
  if (read_text(folder_ + "/live") == "1") write_text(folder_ + "/live", "0");
}

bool SimChip::wire(std::uint32_t offset) const { return read_text(wire_file(offset)) == "1"; }

void SimChip::drive(std::uint32_t offset, bool high) const {
  write_text(lines_ + std::to_string(offset) + "/pull", high ? "pull-up" : "pull-down");
}

HeldLine::HeldLine(const std::string& chip, std::uint32_t offset, const std::string& program) {
  gpiohandle_request request{};
  request.lineoffsets[0] = offset;
  request.lines = 1;
  request.flags = GPIOHANDLE_REQUEST_OUTPUT;
  std::strncpy(request.consumer_label, program.c_str(), sizeof request.consumer_label - 1);
  const int fd = ::open(("/dev/" + chip).c_str(), O_RDWR | O_CLOEXEC);
  const int result = ::ioctl(fd, GPIO_GET_LINEHANDLE_IOCTL, &request);
  ::close(fd);
  if (result != 0) throw std::runtime_error("cannot hold a line: " + std::string(std::strerror(errno)));
  fd_ = request.fd;
}

HeldLine::~HeldLine() { ::close(fd_); }

void wait_for(Duration time) { std::this_thread::sleep_for(std::chrono::nanoseconds(time.ns())); }

void wait_until(Instant at) {
  const timespec until{at.ns() / 1'000'000'000, at.ns() % 1'000'000'000};
  while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {}
}

}  // namespace nodal::hil
