#include <endian.h>
#include <linux/usb/functionfs.h>

#include <cstring>

#include "hal/linux/cable/function_fs.h"

namespace nodal::hal::cable {
namespace {

constexpr std::uint16_t kEnglish = 0x0409;
constexpr std::uint8_t kFromHost = 1 | USB_DIR_OUT;
constexpr std::uint8_t kToHost = 2 | USB_DIR_IN;

void put(std::vector<std::uint8_t>& bytes, const auto& value) {
  bytes.resize(bytes.size() + sizeof(value));
  std::memcpy(bytes.data() + bytes.size() - sizeof(value), &value, sizeof(value));
}

usb_endpoint_descriptor_no_audio bulk(std::uint8_t address, std::uint16_t packet) {
  usb_endpoint_descriptor_no_audio endpoint{};
  endpoint.bLength = sizeof(endpoint);
  endpoint.bDescriptorType = USB_DT_ENDPOINT;
  endpoint.bEndpointAddress = address;
  endpoint.bmAttributes = USB_ENDPOINT_XFER_BULK;
  endpoint.wMaxPacketSize = htole16(packet);
  return endpoint;
}

/// Interface, from-host endpoint (the file ep1), to-host endpoint (ep2).
void put_interface(std::vector<std::uint8_t>& bytes, std::uint16_t packet, bool companions) {
  usb_interface_descriptor interface {};
  interface.bLength = sizeof(interface);
  interface.bDescriptorType = USB_DT_INTERFACE;
  interface.bNumEndpoints = 2;
  interface.bInterfaceClass = kClass;
  interface.bInterfaceSubClass = kSubclass;
  interface.bInterfaceProtocol = kProtocol;
  interface.iInterface = 1;
  put(bytes, interface);
  usb_ss_ep_comp_descriptor companion{};
  companion.bLength = sizeof(companion);
  companion.bDescriptorType = USB_DT_SS_ENDPOINT_COMP;
  companion.bMaxBurst = 15;
  for (const std::uint8_t address : {kFromHost, kToHost}) {
    put(bytes, bulk(address, packet));
    if (companions) put(bytes, companion);
  }
}

void set_length(std::vector<std::uint8_t>& bytes) {
  const std::uint32_t length = htole32(static_cast<std::uint32_t>(bytes.size()));
  std::memcpy(bytes.data() + sizeof(std::uint32_t), &length, sizeof(length));
}

}  // namespace

std::vector<std::uint8_t> function_descriptors() {
  std::vector<std::uint8_t> bytes;
  usb_functionfs_descs_head_v2 head{};
  head.magic = htole32(FUNCTIONFS_DESCRIPTORS_MAGIC_V2);
  head.flags = htole32(FUNCTIONFS_HAS_FS_DESC | FUNCTIONFS_HAS_HS_DESC | FUNCTIONFS_HAS_SS_DESC);
  put(bytes, head);
  for (const std::uint32_t descriptors : {3U, 3U, 5U}) put(bytes, htole32(descriptors));
  put_interface(bytes, kPacketBytes, false);
  put_interface(bytes, 512, false);
  put_interface(bytes, 1024, true);
  set_length(bytes);
  return bytes;
}

std::vector<std::uint8_t> function_strings(const std::string& rig) {
  std::vector<std::uint8_t> bytes;
  usb_functionfs_strings_head head{};
  head.magic = htole32(FUNCTIONFS_STRINGS_MAGIC);
  head.str_count = htole32(1U);
  head.lang_count = htole32(1U);
  put(bytes, head);
  put(bytes, htole16(kEnglish));
  bytes.insert(bytes.end(), rig.begin(), rig.end());  // at most 64 characters; a string descriptor holds 126
  bytes.push_back(0);
  set_length(bytes);
  return bytes;
}

}  // namespace nodal::hal::cable
