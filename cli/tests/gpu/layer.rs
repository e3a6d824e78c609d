//! A layer of Vulkan that lets a driver fail as a card does: what `FAULT` in the environment says happens.
//!
//! `submit:N` and `wait:N` lose the device after N submissions or waits, `memory:N` has no memory after N buffers;
//! `range:BYTES`, `shared:BYTES` and `invocations:N` are limits that the device then has: of a buffer, of a workgroup's
//! memory, and of its invocations.
//!
//! Compiled by the tests, and loaded by Vulkan's loader into the program that they run. Structures and numbers are those
//! of `vk_layer.h` and `vulkan_core.h`; of structures only what is used here is declared.

#![allow(unsafe_op_in_unsafe_fn)]

use std::ffi::{CStr, c_char, c_void};
use std::mem::transmute;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicPtr, AtomicU64, Ordering::SeqCst};

type Handle = *mut c_void;
type Function = *mut c_void;
type GetAddress = unsafe extern "C" fn(Handle, *const c_char) -> Function;
type Ask = unsafe extern "C" fn(Handle, *mut u8);
type Create = unsafe extern "C" fn(*const Head, Handle, *mut Handle) -> i32;

const OUT_OF_DEVICE_MEMORY: i32 = -2;
const DEVICE_LOST: i32 = -4;
const INSTANCE_CHAIN: i32 = 47;
const DEVICE_CHAIN: i32 = 48;
/// Offset of the limits in `VkPhysicalDeviceProperties`, bytes.
const LIMITS: usize = 296;

/// The beginning of every structure.
#[repr(C)]
struct Head {
    kind: i32,
    next: *mut Chain,
}

/// `VkLayerInstanceCreateInfo`, or that of a device.
#[repr(C)]
struct Chain {
    kind: i32,
    next: *mut Chain,
    function: i32,
    link: *mut Link,
}

/// The next layer of an instance or a device.
#[repr(C)]
struct Link {
    next: *mut Link,
    of_instance: GetAddress,
    of_device: GetAddress,
}

/// `VkNegotiateLayerInterface`.
#[repr(C)]
pub struct Interface {
    kind: i32,
    next: *mut c_void,
    version: u32,
    of_instance: GetAddress,
    of_device: GetAddress,
    of_physical_device: Function,
}

/// Function that comes after this layer.
struct Below(AtomicPtr<c_void>);

static INSTANCE: Below = Below(AtomicPtr::new(null_mut()));
static INSTANCE_BELOW: Below = Below(AtomicPtr::new(null_mut()));
static DEVICE_BELOW: Below = Below(AtomicPtr::new(null_mut()));
static PROPERTIES: Below = Below(AtomicPtr::new(null_mut()));
static PROPERTIES_2: Below = Below(AtomicPtr::new(null_mut()));
static MAKE_BUFFER: Below = Below(AtomicPtr::new(null_mut()));
static SUBMIT: Below = Below(AtomicPtr::new(null_mut()));
static WAIT: Below = Below(AtomicPtr::new(null_mut()));
static COUNT: AtomicU64 = AtomicU64::new(0);

impl Below {
    fn set(&self, function: Function) {
        self.0.store(function, SeqCst);
    }

    fn function(&self) -> Function {
        self.0.load(SeqCst)
    }
}

/// The number of the fault of this name, if it is the one.
fn fault(name: &str) -> Option<u64> {
    let fault = std::env::var("FAULT").ok()?;
    fault.strip_prefix(name)?.strip_prefix(':')?.parse().ok()
}

/// Counts, and says whether this one fails.
fn fails(name: &str) -> bool {
    fault(name).is_some_and(|after| COUNT.fetch_add(1, SeqCst) >= after)
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn vkNegotiateLoaderLayerInterfaceVersion(asked: *mut Interface) -> i32 {
    (*asked).version = 2;
    (*asked).of_instance = of_instance;
    (*asked).of_device = of_device;
    (*asked).of_physical_device = null_mut();
    0
}

unsafe extern "C" fn of_instance(instance: Handle, name: *const c_char) -> Function {
    let ours = ours(name);
    if !ours.is_null() {
        return ours;
    }
    let below: GetAddress = transmute(INSTANCE_BELOW.function());
    below(instance, name)
}

unsafe extern "C" fn of_device(device: Handle, name: *const c_char) -> Function {
    let ours = ours(name);
    if !ours.is_null() {
        return ours;
    }
    let below: GetAddress = transmute(DEVICE_BELOW.function());
    below(device, name)
}

unsafe fn ours(name: *const c_char) -> Function {
    match CStr::from_ptr(name).to_str().unwrap_or_default() {
        "vkGetInstanceProcAddr" => of_instance as Function,
        "vkGetDeviceProcAddr" => of_device as Function,
        "vkCreateInstance" => create_instance as Function,
        "vkCreateDevice" => create_device as Function,
        "vkGetPhysicalDeviceProperties" => properties as Function,
        "vkGetPhysicalDeviceProperties2" | "vkGetPhysicalDeviceProperties2KHR" => {
            properties_2 as Function
        }
        "vkCreateBuffer" => make_buffer as Function,
        "vkQueueSubmit" => submit as Function,
        "vkWaitSemaphores" | "vkWaitSemaphoresKHR" => wait as Function,
        _ => null_mut(),
    }
}

/// The link of this layer, which it takes out of the chain.
unsafe fn link(info: *const Head, kind: i32) -> *mut Link {
    let mut chain = (*info).next;
    while (*chain).kind != kind || (*chain).function != 0 {
        chain = (*chain).next;
    }
    let link = (*chain).link;
    (*chain).link = (*link).next;
    link
}

unsafe extern "C" fn create_instance(
    info: *const Head,
    allocator: Handle,
    made: *mut Handle,
) -> i32 {
    let next = (*link(info, INSTANCE_CHAIN)).of_instance;
    INSTANCE_BELOW.set(next as Function);
    let create: Create = transmute(next(null_mut(), c"vkCreateInstance".as_ptr()));
    let result = create(info, allocator, made);
    INSTANCE.set(*made);
    PROPERTIES.set(next(*made, c"vkGetPhysicalDeviceProperties".as_ptr()));
    PROPERTIES_2.set(next(*made, c"vkGetPhysicalDeviceProperties2".as_ptr()));
    result
}

unsafe extern "C" fn create_device(
    physical: Handle,
    info: *const Head,
    allocator: Handle,
    made: *mut Handle,
) -> i32 {
    let link = link(info, DEVICE_CHAIN);
    let (of_instance, next) = ((*link).of_instance, (*link).of_device);
    DEVICE_BELOW.set(next as Function);
    type CreateDevice = unsafe extern "C" fn(Handle, *const Head, Handle, *mut Handle) -> i32;
    let create: CreateDevice =
        transmute(of_instance(INSTANCE.function(), c"vkCreateDevice".as_ptr()));
    let result = create(physical, info, allocator, made);
    MAKE_BUFFER.set(next(*made, c"vkCreateBuffer".as_ptr()));
    SUBMIT.set(next(*made, c"vkQueueSubmit".as_ptr()));
    WAIT.set(next(*made, c"vkWaitSemaphores".as_ptr()));
    result
}

/// `VkPhysicalDeviceProperties`.
unsafe extern "C" fn properties(physical: Handle, properties: *mut u8) {
    let below: Ask = transmute(PROPERTIES.function());
    below(physical, properties);
    limit(properties.add(LIMITS));
}

/// `VkPhysicalDeviceProperties2` has the other one after its head.
unsafe extern "C" fn properties_2(physical: Handle, properties: *mut u8) {
    let below: Ask = transmute(PROPERTIES_2.function());
    below(physical, properties);
    limit(properties.add(size_of::<Head>() + LIMITS));
}

/// Lowers a limit.
unsafe fn limit(limits: *mut u8) {
    for (name, at) in [("range", 28), ("shared", 216), ("invocations", 232)] {
        if let Some(limit) = fault(name) {
            *limits.add(at).cast::<u32>() = limit as u32;
        }
    }
}

unsafe extern "C" fn make_buffer(device: Handle, info: Handle, hooks: Handle, made: Handle) -> i32 {
    if fails("memory") {
        return OUT_OF_DEVICE_MEMORY;
    }
    let below: unsafe extern "C" fn(Handle, Handle, Handle, Handle) -> i32 =
        transmute(MAKE_BUFFER.function());
    below(device, info, hooks, made)
}

unsafe extern "C" fn submit(queue: Handle, count: u32, what: Handle, fence: u64) -> i32 {
    if fails("submit") {
        return DEVICE_LOST;
    }
    let below: unsafe extern "C" fn(Handle, u32, Handle, u64) -> i32 = transmute(SUBMIT.function());
    below(queue, count, what, fence)
}

unsafe extern "C" fn wait(device: Handle, info: Handle, timeout: u64) -> i32 {
    if fails("wait") {
        return DEVICE_LOST;
    }
    let below: unsafe extern "C" fn(Handle, Handle, u64) -> i32 = transmute(WAIT.function());
    below(device, info, timeout)
}
