//! Sorting into a few buckets.

/// Numbers of items by bucket, each bucket's in order.
#[derive(Debug)]
pub(crate) struct Buckets {
    items: Vec<u32>,
    /// Where each bucket's begin, and the end.
    begins: Vec<u32>,
}

impl Buckets {
    /// By counting, from the bucket of each item, below `count`.
    pub fn new(count: usize, buckets: impl Iterator<Item = u32>) -> Self {
        let buckets: Vec<u32> = buckets.collect();
        let mut begins = vec![0; count + 1];
        for &bucket in &buckets {
            begins[bucket as usize + 1] += 1;
        }
        for bucket in 0..count {
            begins[bucket + 1] += begins[bucket];
        }
        let mut next = begins.clone();
        let mut items = vec![0; buckets.len()];
        for (item, bucket) in (0..).zip(buckets) {
            let at = &mut next[bucket as usize];
            items[*at as usize] = item;
            *at += 1;
        }
        Self { items, begins }
    }

    /// The items of a bucket.
    pub fn get(&self, bucket: usize) -> &[u32] {
        &self.items[self.begins[bucket] as usize..self.begins[bucket + 1] as usize]
    }
}
