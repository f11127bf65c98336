// Appends to queues with one atomic operation for each subgroup.

// The place of a new element at the end of a queue, if this invocation has one. Invocations that run together at this
// place, however many, form the subgroup; each must call it.
fn append(queue: u32, has_element: bool) -> u32 {
  let own = select(0u, 1u, has_element);
  let before = subgroupExclusiveAdd(own);
  let count = subgroupAdd(own);
  // The first invocation with an element makes room for all
  var first = 0u;
  if (has_element && before == 0u) { first = atomicAdd(&queued[queue], count); }
  return subgroupMax(first) + before;
}
