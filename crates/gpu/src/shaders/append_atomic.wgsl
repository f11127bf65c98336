// Appends to queues with one atomic operation for each element.

// The place of a new element at the end of a queue, if this invocation has one.
fn append(queue: u32, has_element: bool) -> u32 {
  if (!has_element) { return 0u; }
  return atomicAdd(&queued[queue], 1u);
}
